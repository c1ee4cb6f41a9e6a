"""Analysis of archives: many logs of many sites, in parallel, with present settings."""

from monitor.archive.catalog import ArchiveLog, find_logs
from monitor.archive.reanalysis import AnalysedLog, LogTexts, reanalyse, steps_key, steps_of, texts_of

__all__ = ["AnalysedLog", "ArchiveLog", "LogTexts", "find_logs", "reanalyse", "steps_key", "steps_of", "texts_of"]
