"""Settings of all tests: hypothesis draws the same examples each time.

`pytest --hypothesis-profile=explore` draws new ones, to look for what nobody has thought of.
"""

from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("explore", max_examples=1000, deadline=None)
settings.load_profile("fixed")
