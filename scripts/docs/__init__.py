"""The documentation site: pages by hand, and what `build_docs.py` generates for them."""
