"""A panel to drive the table by hand: one page in a browser, a controller in real time, the plant behind the link.

`moves` and `programs` give the reference at any time, `drive` joins them, `interlocks` compare with limits, `engine` is
the controller of one sample, `ring` takes its rows out of the process without waiting.
"""
