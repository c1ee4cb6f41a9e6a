"""The tables; times are ns UTC, days are counted from 1970-01-01 UTC, every row belongs to a site."""

from typing import Any

from sqlalchemy import BigInteger, Boolean, Column, Float, Index, Integer, MetaData, String, Table, Text

metadata = MetaData()
DAY = 86_400 * 10**9  # ns
HOUR = DAY // 24


def _of_site(name: str, *columns: Column[Any] | Index) -> Table:
    site: Column[int] = Column("site", Integer, primary_key=True, autoincrement=False)  # number in `sites`
    return Table(name, metadata, site, *columns)


versions = Table("schema_version", metadata, Column("version", Integer, primary_key=True, autoincrement=False))

sites = Table(
    "sites",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(200), nullable=False, unique=True),  # empty: the only site of a file
)

states = _of_site(
    "site_states",  # the present state of each site, by its monitor
    Column("time", BigInteger, nullable=False),  # of writing, by the clock of the database
    Column("state", String(16), nullable=False),
    Column("since", BigInteger, nullable=False),  # when it began, likewise
    Column("window_age", Float),  # since the last window, at the time of writing [s]
    Column("overdue", Boolean, nullable=False),  # whether a window is
    Column("problems", Text, nullable=False),  # JSON: list of texts
    Column("url", Text, nullable=False),  # address of its status page; empty if unknown
    Column("place", Text, nullable=False),  # host and folder of its monitor
)

windows = _of_site(
    "windows",
    Column("end", BigInteger, primary_key=True, autoincrement=False),
    Column("start", BigInteger, nullable=False),
    Column("number", Integer, nullable=False),  # counted from 0 since the monitor's start
    Column("phase", String(16), nullable=False),
    Column("n_modes", Integer, nullable=False),
    Column("t2", Float),
    Column("limit", Float),
    Column("problem", Text),
)

modes = _of_site(
    "modes",
    Column("mode", Integer, primary_key=True, autoincrement=False),
    Column("end", BigInteger, primary_key=True, autoincrement=False),  # of the window
    Column("frequency", Float, nullable=False),  # Hz
    Column("frequency_std", Float),
    Column("damping", Float),
    Column("damping_std", Float),
    Column("shift_percent", Float),
    Column("shift_std_percent", Float),
    Index("modes_by_time", "site", "end"),
)

diagnoses = _of_site(
    "diagnoses",
    Column("end", BigInteger, primary_key=True, autoincrement=False),  # of the window
    Column("verdict", String(32), nullable=False),
    Column("text", Text, nullable=False),
    Column("json", Text, nullable=False),
)

references = _of_site(
    "baselines",  # names reserved in SQL are avoided
    Column("time", BigInteger, primary_key=True, autoincrement=False),
    Column("n_windows", Integer, nullable=False),
    Column("json", Text, nullable=False),
)

alarms = _of_site(
    "alarms",
    Column("raised", BigInteger, primary_key=True, autoincrement=False),
    Column("cleared", BigInteger),
    Column("lasted", Float),  # s
    Column("acknowledged", BigInteger),
    Column("text", Text, nullable=False),  # present text
    Column("reopened", Integer, nullable=False),  # how often
)

changes = _of_site(
    "alarm_changes",
    Column("time", BigInteger, primary_key=True, autoincrement=False),
    Column("kind", String(16), primary_key=True),
    Column("state", String(16), primary_key=True),
    Column("number", Integer, nullable=False),  # of the last window by then
    Column("quiet", Boolean, nullable=False),
    Column("text", Text, nullable=False),
)

events = _of_site(
    "events",
    Column("time", BigInteger, primary_key=True, autoincrement=False),
    Column("topic", String(64), primary_key=True),
    Column("device", String(64), primary_key=True),  # empty for events without a device
    Column("json", Text, nullable=False),
    Index("events_by_topic", "site", "topic", "time"),
)


def _mode_figures(period: str) -> Table:
    """Return a table of each mode in each hour or day, counted from 1970-01-01 UTC."""
    return _of_site(
        f"mode_{period}s",
        Column("mode", Integer, primary_key=True, autoincrement=False),
        Column(period, Integer, primary_key=True, autoincrement=False),
        Column("n", Integer, nullable=False),  # windows that show the mode
        Column("frequency", Float, nullable=False),  # mean [Hz]
        Column("lowest", Float, nullable=False),
        Column("highest", Float, nullable=False),
        Column("damping", Float),
        Column("shift_percent", Float),
    )


mode_hours, mode_days = _mode_figures("hour"), _mode_figures("day")


def _by_time(figures: Table, period: str) -> Index:
    """Return an index with all columns.

    The rows of one hour or day of all sites are together in the table, those of one site in the index.
    """
    included = [column.name for column in figures.columns if column.name not in ("site", period)]
    index = Index(f"{figures.name}_by_time", figures.c.site, figures.c[period], postgresql_include=included)
    return index.ddl_if(dialect="postgresql")  # a file holds one site


mode_hours_by_time, mode_days_by_time = _by_time(mode_hours, "hour"), _by_time(mode_days, "day")

window_days = _of_site(
    "window_days",
    Column("day", Integer, primary_key=True, autoincrement=False),
    Column("n", Integer, nullable=False),  # windows
    Column("n_judged", Integer, nullable=False),
    Column("n_over", Integer, nullable=False),  # over the limit
    Column("level", Float),  # highest novelty over its limit
)
