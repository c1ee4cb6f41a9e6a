"""Analysis of archives: many logs of many sites, in parallel, with present settings."""

from monitor.archive.catalog import ArchiveLog as ArchiveLog
from monitor.archive.catalog import LogPiece as LogPiece
from monitor.archive.catalog import find_logs as find_logs
from monitor.archive.log_texts import LogTexts as LogTexts
from monitor.archive.log_texts import steps_key as steps_key
from monitor.archive.log_texts import texts_of as texts_of
from monitor.archive.reanalysis import AnalysedLog as AnalysedLog
from monitor.archive.reanalysis import reanalyse as reanalyse
from monitor.archive.steps import read_steps as read_steps
