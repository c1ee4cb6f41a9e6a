"""The MCAP log of a run: writers, readers, repair and retention.

The analysis process is fed by the writer thread: what is analysed is what is logged.
"""
