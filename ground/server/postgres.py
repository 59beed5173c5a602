# SPDX-License-Identifier: Apache-2.0
"""Decoded parameters in PostgreSQL: any number of servers write into one database, where SQL and Grafana read them.

What is written is read from the archive, behind what the database says that it has: so the server never waits for
the database, and nothing is missing after one of them was down. A packet's values and the new position of the
spacecraft are one transaction.

    [postgres]
    url        = "postgresql://fledge@db.example/telemetry"
    parameters = ["flight.*"]           # * and ? are any characters; all by default
    partition  = "1 day"                # of time, for each table: N hours, days or weeks
    server     = "north"                # the host and the folder by default

docs/control-room.md shows the tables.
"""
from __future__ import annotations

import re
import socket
from dataclasses import dataclass
from threading import Event as Flag, Thread
from typing import TYPE_CHECKING, Any

import numpy as np
import psycopg

from fledge.ground.server.postgres_rows import COPY, DIGEST, LOCK, Connection, Rows, Tail, find, number_of
from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.ground.server.room import Room
    from fledge.ground.server.spacecraft import Spacecraft

HOUR = 3600 * 10**9                     # [ns]
UNITS = {"hour": HOUR, "day": 24 * HOUR, "week": 168 * HOUR}
FIRST, LONGEST = 1.0, 30.0              # [s] until a database that does not answer is tried again

SCHEMA = f"""
create schema if not exists fledge;
create table if not exists fledge.setting (name text primary key, value text not null);
create table if not exists fledge.server (id smallserial primary key, name text not null unique);
create table if not exists fledge.spacecraft (id smallserial primary key, name text not null unique);
create table if not exists fledge.parameter (
    id serial primary key, spacecraft smallint not null references fledge.spacecraft, name text not null,
    unit text not null, kind text not null, labels text[] not null, description text not null,
    first_server smallint not null references fledge.server, digest text);
alter table fledge.parameter add column if not exists digest text;
alter table fledge.parameter drop constraint if exists parameter_spacecraft_name_unit_kind_labels_key;
update fledge.parameter set digest = {DIGEST} where digest is null;
create unique index if not exists parameter_digest on fledge.parameter (spacecraft, digest);
create table if not exists fledge.progress (
    server smallint references fledge.server, spacecraft smallint references fledge.spacecraft,
    session bigint not null, t_ns bigint not null, packets bigint not null, primary key (server, spacecraft));
create table if not exists fledge.value (
    t timestamptz not null, received timestamptz not null, packet bigint not null, value double precision,
    parameter integer not null, session integer not null, server smallint not null, ns smallint not null,
    concern smallint not null, text text) partition by range (t);
create index if not exists value_parameter_t on fledge.value (parameter, t);
create or replace view fledge.telemetry as
    select c.name as spacecraft, p.name as parameter, p.unit, v.t, v.ns, v.value,
           case p.kind when 'label' then coalesce(v.text, p.labels[v.value::int + 1]) else v.text end as text,
           v.concern, v.received, v.session, s.name as server
    from fledge.value v join fledge.parameter p on p.id = v.parameter join fledge.spacecraft c on c.id = p.spacecraft
         join fledge.server s on s.id = v.server
    where v.server = p.first_server or not exists (
        select from fledge.value w where w.parameter = v.parameter and w.packet = v.packet and w.server < v.server
        and w.t between v.t - interval '5 seconds' and v.t + interval '5 seconds');
"""


@dataclass(frozen=True)
class PostgresSettings:
    url: str
    parameters: tuple[str, ...] = ("*",)
    partition: int = 24 * HOUR          # [ns]
    server: str = ""

    @classmethod
    def read(cls, table: dict[str, Any]) -> PostgresSettings:
        """From the table of FILE. Raises SetupError."""
        if unknown := sorted(set(table) - {"url", "parameters", "partition", "server"}):
            raise SetupError(f"[postgres] has url, parameters, partition and server, not {unknown[0]}")
        url, names, server = table.get("url"), table.get("parameters", ["*"]), table.get("server", "")
        if not isinstance(url, str) or not url:
            raise SetupError('[postgres] has a url, as url = "postgresql://user@host/database"')
        try:
            psycopg.conninfo.conninfo_to_dict(url)
        except psycopg.ProgrammingError as error:
            raise SetupError(f"[postgres] url is no address of a database: {str(error).strip()}") from None
        if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
            raise SetupError(f'[postgres] parameters is a list of names, as ["flight.*"]; it is {names!r}')
        if not isinstance(server, str):
            raise SetupError(f"[postgres] server is a name; it is {server!r}")
        width = table.get("partition", "1 day")
        parts = re.fullmatch(r"([1-9]\d{0,2}) (hour|day|week)s?", width) if isinstance(width, str) else None
        if parts is None:
            raise SetupError(f'[postgres] partition is hours, days or weeks, as "1 day"; it is {width!r}')
        return cls(url, tuple(names), int(parts[1]) * UNITS[parts[2]], server)


class Postgres:
    """Writes the archives of a room's spacecraft into a database, in a thread of its own."""

    def __init__(self, settings: PostgresSettings, room: Room) -> None:
        self.settings, self.room = settings, room
        self.name = settings.server or f"{socket.gethostname()}:{room.settings.folder.resolve()}"
        self.problem = ""               #: why nothing is written; "": all is well
        self._over = Flag()
        self._thread = Thread(target=self._run, name="postgres", daemon=True)
        self._tails: dict[str, Tail] = {}
        self._wrong: dict[str, str] = {}        # of a spacecraft
        self._partitions: set[int] = set()
        self._id = 0

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """End. The next start of the server writes the values that are still missing."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(timeout=10)

    def _run(self) -> None:
        wait = FIRST
        while not self._over.is_set():
            try:
                with psycopg.connect(self.settings.url, autocommit=True, connect_timeout=10,
                                     application_name="fledge") as base:
                    self._tails.clear()
                    self._partitions.clear()
                    self._begin(base)
                    self._tell("")
                    while not self._over.is_set():
                        busy = [self._tail(base, craft)
                                for craft in list(self.room.crafts.values()) if not craft.source]
                        wait = FIRST
                        if not any(busy):
                            self._over.wait(1)
            except (psycopg.Error, SetupError, OSError, ValueError) as error:      # also a text that is none
                self._tell(str(error).strip().splitlines()[0] if str(error) else type(error).__name__)
                self._over.wait(wait)
                wait = min(2 * wait, LONGEST)

    def _tell(self, problem: str) -> None:
        """An event when it begins and when it is over."""
        if problem != self.problem:
            text = f"nothing is written into PostgreSQL: {problem}; it is caught up from the archive" if problem else \
                "PostgreSQL is written again"
            for name in self.room.crafts:
                self.room.report(name, "warning" if problem else "info", "postgres", text)
        self.problem = problem

    def _begin(self, base: Connection) -> None:
        """The tables, and this server's number. Raises SetupError."""
        with base.transaction():
            base.execute("select pg_advisory_xact_lock(%s)", (LOCK,))
            base.execute(SCHEMA)
            base.execute("insert into fledge.setting values ('partition_s', %s) on conflict do nothing",
                         (str(self.settings.partition // 10**9),))
            width = find(base, "select value from fledge.setting where name = 'partition_s'")
            if int(width) * 10**9 != self.settings.partition:
                raise SetupError(f"the database has partitions of {int(width) / 3600:g} hours, and [postgres] "
                                 f"partition says {self.settings.partition / HOUR:g}")
            self._id = number_of(base, "server", self.name)

    def _tail(self, base: Connection, craft: Spacecraft) -> bool:
        """Write what the archive of a spacecraft has; whether there was something. What is wrong with one does not stop
        the others."""
        try:
            return self._catch_up(base, craft)
        except SetupError as error:
            if self._wrong.get(craft.name) != str(error):
                self._wrong[craft.name] = str(error)
                self.room.report(craft.name, "warning", "postgres", f"nothing is written into PostgreSQL: {error}")
            return False

    def _catch_up(self, base: Connection, craft: Spacecraft) -> bool:
        tail = self._tails.get(craft.name)
        if tail is None or tail.database is not craft.telemetry.database:
            tail = self._tails[craft.name] = Tail(craft, self.room, self.settings.parameters, base, self._id)
        any_ = False
        for rows in tail.rows():
            any_ = True
            self._write(base, tail, rows)
            if self._over.is_set():
                break
        return any_

    def _write(self, base: Connection, tail: Tail, rows: Rows) -> None:
        width = self.settings.partition // 1000
        for place in {int(place) for place in np.unique(rows.t_us // width)} - self._partitions:
            self._partition(base, place)
            self._partitions.add(place)
        with base.transaction():
            if rows.bytes:
                with base.cursor().copy(COPY) as copy:
                    copy.write(b"PGCOPY\n\xff\r\n\0" + bytes(8))
                    for part in rows.bytes:
                        copy.write(part)
                    copy.write(b"\xff\xff")
            base.execute("""insert into fledge.progress values (%s, %s, %s, %s, %s) on conflict (server, spacecraft)
                do update set session = excluded.session, t_ns = excluded.t_ns, packets = excluded.packets""",
                         (self._id, tail.craft_id, *rows.position))

    def _partition(self, base: Connection, place: int) -> None:
        """The table of a stretch of time. Attaching it does not block readers and writers of other tables."""
        width = self.settings.partition // 1000     # [us]
        with base.transaction():
            base.execute("select pg_advisory_xact_lock(%s)", (LOCK,))
            begin, end = (base.execute("select timestamptz 'epoch' + %s * interval '1 us'", (at * width,)).fetchone()
                          for at in (place, place + 1))
            assert begin and end
            name = f"value_{np.datetime64(place * width, 'us').astype('M8[h]')}".replace("-", "").replace("T", "_")
            if find(base, "select to_regclass(%s)", f"fledge.{name}") is None:
                base.execute(f"create table fledge.{name} (like fledge.value)")
                base.execute(f"alter table fledge.value attach partition fledge.{name} "     # a bound is no parameter
                             f"for values from ('{begin[0].isoformat()}') to ('{end[0].isoformat()}')")
