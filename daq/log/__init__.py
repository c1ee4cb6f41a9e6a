"""The MCAP log of a run: writers, readers, repair and retention.

The analysis process is fed by the writer thread: all analysed data are logged.
"""
