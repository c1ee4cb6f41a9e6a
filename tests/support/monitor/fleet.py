"""A database of many sites, filled by the server: windows of the last days, daily figures, alarms, events, states."""

from dataclasses import dataclass

from sqlalchemy import create_engine

from monitor.outputs.history import HistoryStore
from monitor.outputs.history.schema import DAY, HOUR

STEP = 600 * 10**9  # ns between two windows


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Size of a database."""

    sites: int
    days: int  #: with daily figures, alarms and events
    keep_days: int  #: of them with single windows
    modes: int = 8
    events_per_day: int = 4


#: kinds of sites: share of them, state, time since it lasts [s], age of the state [s], problems
KINDS = (
    ("alarm", 0.02, "alarm", 5000, 20, "[]"),
    ("acknowledged", 0.01, "alarm", 50_000, 20, "[]"),
    ("stale", 0.02, "normal", 90_000, 4000, "[]"),
    ("faulty", 0.03, "normal", 90_000, 20, '["device left is lost"]'),
    ("watch", 0.01, "watch", 600, 20, "[]"),
    ("learning", 0.02, "learning", 3000, 20, "[]"),
    ("normal", 1.0, "normal", 90_000, 20, "[]"),
)


def fill(url: str, fleet: Fleet) -> None:
    """Fill an empty PostgreSQL database with rows that end now."""
    HistoryStore(url).__exit__()
    engine = create_engine(url.replace("postgresql:", "postgresql+psycopg:"))
    now = "(extract(epoch from now())::bigint * 1000000000)"
    numbers = {
        "now": f"({now} / {STEP} * {STEP})",
        "today": f"({now} / {DAY})",
        "per_day": DAY // STEP,
        "n": fleet.keep_days * DAY // STEP,
        "events": fleet.days * fleet.events_per_day,
        "event_step": DAY // fleet.events_per_day,
        "site": "site",
        "level": "0.2 + 0.6 * random()",
        # in the order in which monitors write them, the modes of a site together: each series depends on the last one
        "rows": f"generate_series(1, {fleet.sites} + 0 * i) site, generate_series(1, {fleet.modes} + 0 * site) mode",
    } | fleet.__dict__
    with engine.begin() as connection:
        for statement in (_FILL + _states(fleet)).format(day=DAY, hour=HOUR, step=STEP, **numbers).split(";"):
            if statement.strip():
                connection.exec_driver_sql(statement)
    engine.dispose()


_FILL = """
ALTER TABLE modes DROP CONSTRAINT modes_pkey;
DROP INDEX modes_by_time;
DROP INDEX mode_hours_by_time;
DROP INDEX mode_days_by_time;
DELETE FROM sites;
INSERT INTO sites (id, name) SELECT site, 'structure ' || lpad(site::text, 4, '0')
  FROM generate_series(1, {sites}) site;
SELECT setval('sites_id_seq', {sites});
INSERT INTO windows SELECT site, {now} - ({n} - i) * {step}, {now} - ({n} - i + 1) * {step}, i, 'watching', {modes},
  4 * ({level}), 4.0, NULL FROM generate_series(1, {n}) i, generate_series(1, {sites}) site;
INSERT INTO modes SELECT site, mode, {now} - ({n} - i) * {step}, 3.0 * mode * (1 + 0.002 * sin(i / 100.0)), 0.001, 0.01,
  0.001, 0.2 * sin(i / 100.0), 0.05
  FROM generate_series(1, {n}) i, {rows};
ALTER TABLE modes ADD PRIMARY KEY (site, mode, "end");
CREATE INDEX modes_by_time ON modes (site, "end");
INSERT INTO window_days SELECT site, {today} - {days} + i, {per_day}, {per_day}, 0, {level}
  FROM generate_series(1, {days}) i, generate_series(1, {sites}) site;
INSERT INTO mode_days SELECT site, mode, {today} - {days} + i, {per_day}, 3.0 * mode * (1 + 0.005 * sin(i / 58.0)),
  3.0 * mode * 0.99, 3.0 * mode * 1.01, 0.01, 0.5 * sin(i / 58.0)
  FROM generate_series(1, {days}) i, {rows};
CREATE INDEX mode_days_by_time ON mode_days (site, day)
  INCLUDE (mode, n, frequency, lowest, highest, damping, shift_percent);
INSERT INTO mode_hours SELECT site, mode, ("end" - 1) / {hour}, count(*), avg(frequency), min(frequency),
  max(frequency), avg(damping), avg(shift_percent) FROM modes GROUP BY site, mode, ("end" - 1) / {hour}
  ORDER BY 3, 1, 2;
CREATE INDEX mode_hours_by_time ON mode_hours (site, hour)
  INCLUDE (mode, n, frequency, lowest, highest, damping, shift_percent);
INSERT INTO alarms SELECT site, {now} - 30 * i * {day} - 3600000000000, {now} - 30 * i * {day}, 3600.0, NULL,
  'ALARM: the structure has changed (not yet explained)', 0
  FROM generate_series(1, {days} / 30) i, generate_series(1, {sites}) site;
INSERT INTO alarm_changes SELECT site, raised, 'state', 'alarm', 1, false, text FROM alarms;
INSERT INTO alarm_changes SELECT site, cleared, 'state', 'normal', 1, false, 'the change is gone' FROM alarms;
INSERT INTO events SELECT site, {now} - ({events} - i) * {event_step}, '/event/gap', 'left',
  '{{"device": "left", "missing": 12, "after": 123456}}'
  FROM generate_series(1, {events}) i, generate_series(1, {sites}) site;
"""


def _states(fleet: Fleet) -> str:
    """Return the statements for the states of all kinds, and the alarms and novelty of those that have changed."""
    made, first, now = [], 0.0, "extract(epoch from now())::bigint"
    for kind, share, state, since, age, problems in KINDS:
        last = min(first + share, 1.0)
        where = f"site > round({first} * {fleet.sites}) AND site <= round({last} * {fleet.sites})"
        sites = f"FROM generate_series(1, {fleet.sites}) site WHERE {where}"
        written, began = (f"({now} - {seconds}) * 1000000000" for seconds in (age, since))
        row = f"site, {written}, '{state}', {began}, 60.0, false, '{problems}', '', 'host:/state'"
        made.append(f"INSERT INTO site_states SELECT {row} {sites}")
        if state == "alarm":
            known = written if kind == "acknowledged" else "NULL"
            text = "ALARM: the structure has changed: 204 ± 11 g added on the column at (0.42, 0.00, 1.37) m"
            row = f"site, {began}, NULL, NULL, {known}, '{text}', 0"
            made.append(f"INSERT INTO alarms SELECT {row} {sites}")
            changed = f'"end" > {began} AND {where}'
            made.append(f"UPDATE windows SET t2 = 8 + 4 * random(), phase = 'alarm' WHERE {changed}")
        first = last
    return ";\n".join(made)
