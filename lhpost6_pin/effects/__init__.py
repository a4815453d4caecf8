"""Effects: which law acts where with which parameters, and the evaluation of all of them at once."""
