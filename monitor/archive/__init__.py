"""Analysis of archives: many logs of many sites, in parallel, with present settings."""

from monitor.archive.catalog import ArchiveLog, find_logs
from monitor.archive.log_texts import LogTexts, steps_key, texts_of
from monitor.archive.reanalysis import AnalysedLog, reanalyse
from monitor.archive.steps import read_steps

__all__ = ["AnalysedLog", "ArchiveLog", "LogTexts", "find_logs", "read_steps", "reanalyse", "steps_key", "texts_of"]
