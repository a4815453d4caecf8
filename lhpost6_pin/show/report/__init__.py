"""Self-contained HTML reports: one page design for every command that reports something.

`page` renders a page from blocks: text, tables and figures as data. `plots` draws channels over time and `charts` over
frequencies, iterations and harmonics, in the units of `scales`. The other modules make the sections of one report each:
a run, the tools of the controller (`tune_*`, `iterate_*`, `sine_*`), a force decomposition, a validation, a calibration
and a discovery.
"""
