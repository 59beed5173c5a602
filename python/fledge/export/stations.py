# SPDX-License-Identifier: Apache-2.0
"""The folders with which a ground station takes a mission: an instance of Yamcs, a plugin of COSMOS.

Both join each flight process by UDP, a packet in each datagram. Ports of the first are 10015 (telemetry) and 10025
(commands); the next process has the next ones.
"""
from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from fledge.commands import REPORTS, Reason
from fledge.export import names
from fledge.export.ground import Ground
from fledge.export.packets import HEADER, Database, Item, Packet
from fledge.export.xtce import ends_open, xtce

TELEMETRY_PORT, COMMAND_PORT = 10015, 10025
YAMCS_SERVICES = ("archive.XtceTmRecorder", "archive.ParameterRecorder", "archive.AlarmRecorder",
                  "archive.EventRecorder", "archive.ReplayServer", "archive.CommandHistoryRecorder",
                  "parameterarchive.ParameterArchive", "parameter.SystemParametersService")


def yamcs(name: str, databases: Sequence[Database], ground: Ground) -> dict[str, str]:
    """File -> text of a folder with etc/ and mdb/, where Yamcs starts: yamcsd --etc-dir etc."""
    name = names.identifier(name)
    lines = [f"# {name}: written by fledge export xtce --yamcs", "services:",
             *(f"  - class: org.yamcs.{service}" for service in YAMCS_SERVICES),
             "  - class: org.yamcs.ProcessorCreatorService", "    args: {name: realtime, type: realtime}", "",
             "dataLinks:"]
    for i, database in enumerate(databases):
        lines += [f"  - name: {database.process}_telemetry", "    class: org.yamcs.tctm.UdpTmDataLink",
                  f"    stream: tm_{database.process}", f"    port: {TELEMETRY_PORT + i}",
                  "    packetPreprocessorClassName: org.yamcs.tctm.cfs.CfsPacketPreprocessor",
                  "    packetPreprocessorArgs:",
                  "      useLocalGenerationTime: true     # flight's time counts from its start",
                  f"  - name: {database.process}_commands", "    class: org.yamcs.tctm.UdpTcDataLink",
                  f"    stream: tc_{database.process}", "    host: localhost", f"    port: {COMMAND_PORT + i}",
                  "    commandPostprocessorClassName: org.yamcs.tctm.cfs.CfsCommandPostprocessor"]
    lines += ["", "mdb:", "  - type: xtce", f"    spec: mdb/{name}.xml", "", "streamConfig:", "  tm:"]
    for database in databases:
        lines += [f"    - name: tm_{database.process}", "      processor: realtime",
                  f"      rootContainer: /{name}/{names.identifier(database.process)}_packet"]
    lines += ["  cmdHist: [cmdhist_realtime]", "  event: [events_realtime]",
              "  param: [pp_realtime, sys_param, proc_param]", "  parameterAlarm: [alarms_realtime]",
              "  eventAlarm: [event_alarms_realtime]", "  invalidTm: invalid_tm_stream", "  tc:"]
    for database in sorted(databases, key=lambda db: -len(db.process)):     # the first pattern that matches counts
        lines += [f"    - name: tc_{database.process}", "      processor: realtime",
                  f'      tcPatterns: ["/{name}/{names.identifier(database.process)}_.*"]']
    server = ["services:", "  - class: org.yamcs.http.HttpServer", "", f"instances: [{name}]", ""]
    return {"etc/yamcs.yaml": "\n".join(server), f"etc/yamcs.{name}.yaml": "\n".join([*lines, ""]),
            f"mdb/{name}.xml": xtce(name, databases, ground, "yamcs")}


def cosmos(name: str, databases: Sequence[Database], ground: Ground) -> dict[str, str]:
    """File -> text of a plugin with a target for each flight process: rake build VERSION=1.0.0 makes its gem.
    COSMOS reads the files of a target in the order of their names."""
    gem = "openc3-cosmos-" + names.identifier(name).lower().replace("_", "-")
    variables, lines = ["VARIABLE host host.docker.internal"], [""]
    out: dict[str, str] = {}
    for i, database in enumerate(databases):
        target = names.identifier(database.process).upper()
        reports = database.dictionary.telemetry + REPORTS & 0x7FF
        variables += [f"VARIABLE {target.lower()}_command_port {COMMAND_PORT + i}",
                      f"VARIABLE {target.lower()}_telemetry_port {TELEMETRY_PORT + i}"]
        lines += [f"TARGET {target} {target}",
                  f"INTERFACE {target}_INT udp_interface.rb <%= host %> <%= {target.lower()}_command_port %> "
                  f"<%= {target.lower()}_telemetry_port %>", f"  MAP_TARGET {target}",
                  f"  PROTOCOL READ_WRITE flight_link_protocol.rb {reports} {database.order}",
                  f"  PORT <%= {target.lower()}_telemetry_port %>/udp", ""]
        folder = f"targets/{target}"
        header = database.chain(database.command(f"{database.process}.reset_flight"))
        sent = [item.name for command in header for item in command.items]
        out |= {f"{folder}/target.txt": "\n".join(["LANGUAGE ruby", *(
            f"IGNORE_PARAMETER {item.upper()}" for item in sent), *(
            f"IGNORE_ITEM {item.name.upper()}" for item in HEADER), ""]),
            f"{folder}/cmd_tlm/1_open.txt": "".join(f"{line}\n" for packet in database.packets if ends_open(packet)
                                                    for line in telemetry(target, database, packet)),
            f"{folder}/cmd_tlm/2_database.xtce": xtce(target, [database], ground, "cosmos"),
            f"{folder}/cmd_tlm/3_commands.txt": "".join(f"{line}\n" for line in commands(target, database, ground))}
    head = f"# {name}: written by fledge export xtce --cosmos"
    return {"plugin.txt": "\n".join([head, *variables, *lines]),
            f"{gem}.gemspec": GEMSPEC.format(gem=gem, name=name), "Rakefile": RAKEFILE,
            "README.md": f"# {name} in COSMOS\n\n`rake build VERSION=1.0.0` makes a gem; install it in the Admin "
            "tool.\n", "lib/flight_link_protocol.rb": PROTOCOL.format(refused=int(Reason.SEQUENCE))} | out


def commands(target: str, database: Database, ground: Ground) -> Iterator[str]:
    """What COSMOS does not read of commands from XTCE: bytes up to their ends, and which are hazardous."""
    for command in database.commands:
        lines = []
        at = sum(each.bits for part in database.chain(command) for each in part.items)
        for item in command.items if not command.abstract else ():
            if item.count:
                lines.append(f'  PARAMETER {item.name.upper()} {at} 0 {kind_of(item)} "" {quoted(item.meaning)}')
        if why := ground.hazardous.get(command.path):
            lines.append(f"  HAZARDOUS {quoted(why)}")
        if lines:
            yield "\n".join([f"SELECT_COMMAND {target} {name_of(command.path)}", *lines])


def telemetry(target: str, database: Database, packet: Packet) -> Iterator[str]:
    """A packet in COSMOS' own words: one that ends with bytes or a text, which its reader of XTCE cannot have. It comes
    before the XTCE, after which COSMOS takes no more telemetry."""
    yield f"TELEMETRY {target} {name_of(packet.path)} BIG_ENDIAN {quoted(packet.about)}"
    for item in HEADER:
        is_id = item.name == "ccsds_apid"
        yield (f"  APPEND_{'ID_' * is_id}ITEM {item.name.upper()} {item.bits} UINT "
               f"{f'{packet.stream & 0x7FF} ' * is_id}{quoted(item.meaning)}")
    for item in packet.items:
        order = "LITTLE_ENDIAN" if (packet.order or database.order) == "little" else "BIG_ENDIAN"
        yield f"  APPEND_ITEM {name_of(item.name)} {item.bits} {kind_of(item)} {quoted(item.meaning)} {order}"
        yield from (f"    STATE {quoted(label)} {value}" for label, value in item.enumerators.items())


def name_of(path: str) -> str:
    return names.identifier(path).upper()


def kind_of(item: Item) -> str:
    return {"char": "STRING", "bytes": "BLOCK"}.get(item.type) or ("UINT" if item.type[0] == "u" else "INT")


def quoted(text: str) -> str:
    return '"' + re.sub(r'["\\<>%\s]+', " ", text) + '"'


GEMSPEC = """# SPDX-License-Identifier: Apache-2.0
Gem::Specification.new do |s|
  s.name = '{gem}'
  s.summary = 'packets and commands of {name}'
  s.authors = ['fledge export xtce']
  s.license = 'Apache-2.0'
  s.version = ENV['VERSION'] || '0.0.1'
  s.files = Dir.glob('{{targets,lib}}/**/*') + %w(Rakefile README.md plugin.txt)
end
"""

RAKEFILE = """# SPDX-License-Identifier: Apache-2.0
task :build do
  sh('gem', 'build', Dir['*.gemspec'][0])
end
"""

PROTOCOL = """# SPDX-License-Identifier: Apache-2.0
require 'openc3/interfaces/protocols/protocol'

module OpenC3
  # Gives a command its sequence, length and checksum. When flight refuses one for its sequence, its report has the last
  # sequence that it accepted: the next command counts on from there.
  class FlightLinkProtocol < Protocol
    def initialize(reports, order = 'big', allow_empty_data = nil)
      super(allow_empty_data)
      @reports = reports.to_i
      @number = order == 'big' ? 'n' : 'v'
      @next = 0
    end

    def write_data(data, extra = nil)
      packet = data.b
      packet[2, 4] = [0xC000 | @next, packet.length - 7].pack('nn')
      @next = (@next + 1) & 0x3FFF
      packet.setbyte(7, 0)
      packet.setbyte(7, packet.each_byte.reduce(0xFF) {{ |sum, byte| sum ^ byte }})
      return packet, extra
    end

    def read_data(data, extra = nil)
      if data.length >= 40 and data.unpack1('n') & 0x7FF == @reports
        reason, last = data.byteslice(30, 4).unpack(@number * 2)
        @next = (last + 1) & 0x3FFF if reason == {refused}
      end
      return super(data, extra)
    end
  end
end
"""
