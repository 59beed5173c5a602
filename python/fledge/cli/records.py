# SPDX-License-Identifier: Apache-2.0
"""`fledge plot RUN`, `fledge view RUN`, `fledge convert RUN`: a record as figures, in 3-D, as CSV, HDF5 or MAT."""
from __future__ import annotations

import argparse

from fledge.cli.arguments import parse_duration
from fledge.cli.console import say, size_of
from fledge.cli.runs import SCENE, WHAT, decodable, open_run
from fledge.errors import Failure, excerpt

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

    from fledge.archive import Archive


def add(command: Callable) -> None:
    """Add the subcommands, by the function of cli.parser() that adds one."""
    sub = command("plot", plot, "plot nadir_spin error.sigma_BR command.u")
    sub.add_argument("run", metavar="RUN", help=WHAT)
    sub.add_argument("fields", nargs="*", metavar="FIELD", help="default: everything, a figure per topic")
    sub.add_argument("--out", metavar="DIR", help="default: beside the record")

    sub = command("view", view, "view earth_imager")
    sub.set_defaults(needs=lambda options: ["view", *["film"] * bool(options.film or options.picture)])
    sub.add_argument("run", metavar="RUN", help=WHAT)
    kind = sub.add_mutually_exclusive_group()
    kind.add_argument("--foxglove", action="store_true", help="write the record with transforms and markers for "
                      "Foxglove's 3-D panel, in place of a page")
    kind.add_argument("--film", metavar="FILE.webp", help="write a film in place of a page")
    kind.add_argument("--picture", metavar="FILE", help="write a picture (.webp, .png) in place of a page")
    sub.add_argument("--out", metavar="FILE", help=f"default: view.html, or run{SCENE}, beside the record")
    sub.add_argument("--look", default="", metavar="TEXT", help="of both: what follows # in the page's address")
    sub.add_argument("--from", dest="begin", metavar="TIME", help="of a film: its first frame (90s, 1h23m)")
    sub.add_argument("--to", dest="end", metavar="TIME", help="of a film: its last frame")
    sub.add_argument("--at", metavar="TIME", help="of a picture; default: the end")
    sub.add_argument("--frames", type=int, default=180, metavar="N",
                     help="of a film, 12.5 a second; default: %(default)s")

    sub = command("convert", convert, "convert nadir_spin --csv --out tables")
    sub.add_argument("run", metavar="RUN", help=WHAT)
    kind = sub.add_mutually_exclusive_group(required=True)
    kind.add_argument("--csv", action="store_true", help="a file per topic")
    kind.add_argument("--hdf5", action="store_true", help="one file")
    kind.add_argument("--mat", action="store_true", help="one file, for MATLAB and Octave")
    kind.add_argument("--oem", action="store_true", help="the orbit as a CCSDS OEM")
    kind.add_argument("--aem", action="store_true", help="the attitude as a CCSDS AEM")
    kind.add_argument("--stk", action="store_true", help="both as STK's files .e and .a")
    kind.add_argument("--spk", type=int, metavar="NUMBER", help="the orbit as a SPICE kernel (.bsp), of a spacecraft "
                      "of this NAIF number, -999 say")
    kind.add_argument("--about", action="store_true", help="write no file; print the outcome, seed, revisions and "
                      "parameters of the run, its topics, and a hash of its messages")
    sub.add_argument("--out", metavar="PATH", help="a folder for --csv, else a file; default: beside the record")
    sub.add_argument("--quaternions", action="store_true", help="with --csv: besides each attitude, its quaternion, "
                     "scalar first")
    sub.add_argument("--xml", action="store_true", help="an OEM or AEM as XML, in place of KEYWORD = value")
    sub.add_argument("--craft", default="", metavar="NAME", help="which spacecraft of several")
    sub.add_argument("--frame", default="ICRF", metavar="NAME", help="of orbits and attitudes: ICRF, TOD, TEME, "
                     "IAU_BODY, ...; default: %(default)s")
    sub.add_argument("--epoch", metavar="DATE", help="UTC of time 0, of a run without a sky; with --center")
    sub.add_argument("--center", metavar="BODY", help="what N is about, as EARTH, of a run without a sky")


def plot(options: argparse.Namespace) -> int:
    from fledge.plot import plot as draw, save

    archive = open_run(options.run)
    folder = options.out or archive.path.parent
    if options.fields:
        figures = [draw(archive, *options.fields)]
    else:  # a figure per topic, a panel per field
        figures = []
        for channel in decodable(archive):
            fields = {f"{channel.name}.{n}": f for n, f in channel.fields.items()
                      if not n.startswith("head.") and f.dtype[0] != "S"}       # a text has no curve
            if channel.count and fields:
                figures.append(draw(archive, *fields, name=channel.name, title=excerpt(channel.name, 100),
                                    titles=[excerpt(f.meaning or f.name, 100) for f in fields.values()]))
    if not figures:
        raise Failure(f"{archive.path}: there is nothing to plot", 1)
    for figure in figures:
        say(str(save(figure, folder)))
    return 0


def view(options: argparse.Namespace) -> int:
    from fledge import scene
    import fledge.scene.film
    import fledge.scene.foxglove

    archive = open_run(options.run)
    if options.picture:
        at = parse_duration(options.at, "--at") if options.at else None
        path = scene.film.picture(scene.of(archive), options.picture, options.look, at)
    elif options.film:
        begin, end = (parse_duration(text, name) if text else None for text, name in
                      ((options.begin, "--from"), (options.end, "--to")))
        path = scene.film.write(scene.of(archive), options.film, options.look, begin, end, options.frames)
    elif options.foxglove:
        path = scene.foxglove.write(scene.of(archive), archive.path,
                                    options.out or archive.path.with_suffix(SCENE))
    else:
        path = scene.view(archive, options.out)
    say(f"{path} ({size_of(path)})")
    return 0


def convert(options: argparse.Namespace) -> int:
    if options.quaternions and not options.csv:
        raise Failure("convert: --quaternions goes with --csv", 2)
    archive = open_run(options.run)
    if options.about:
        return _about(archive)
    if options.oem or options.aem or options.stk or options.spk is not None:
        return _motion(archive, options)
    topics = [channel.topic for channel in decodable(archive)]
    if not topics:
        raise Failure(f"{archive.path}: there is nothing to convert", 1)
    for wanted, ending, write in ((options.hdf5, ".h5", archive.to_hdf5), (options.mat, ".mat", archive.to_mat)):
        if wanted:
            say(str(write(options.out or archive.path.with_suffix(ending), topics)))
    if options.csv:
        for path in archive.to_csv(options.out or archive.path.parent, topics, quaternions=options.quaternions):
            say(str(path))
    return 0


def _motion(archive: Archive, options: argparse.Namespace) -> int:
    """Write a spacecraft's motion in a form of others."""
    from fledge import motion
    from fledge.world import Sky

    if bool(options.epoch) != bool(options.center):
        raise Failure("convert: --epoch and --center go together: the date of time 0, and the body that N is about", 2)
    sky = Sky(options.epoch, options.center) if options.epoch else None
    run = motion.of_run(archive, options.craft, sky)
    if options.spk is not None:
        say(str(motion.write_spk(run, options.out or archive.path, options.spk, options.frame)))
        return 0
    for form in ("e", "a") if options.stk else ("oem",) if options.oem else ("aem",):
        say(str(motion.write(run, form, options.out or archive.path, options.frame, options.xml)))
    return 0


def _about(archive: Archive) -> int:
    """Print a record's facts about its run."""
    from fledge.archive.compare import digest
    from fledge.columns import columns

    about = dict(archive.metadata)
    facts = {**about.pop("run", {}), **{f"revision of {k}": v for k, v in about.pop("revisions", {}).items()},
             **about.pop("end", {})}
    parameters = about.pop("parameters", {})
    say(str(archive.path))
    for line in columns([("" if i else key, value) for key, text in facts.items()
                         for i, value in enumerate(text.split("\n"))], indent="  "):
        say(line)
    say(f"topics, hash {digest(archive, archive.topics)}")
    rows = [(c.name, str(c.count), c.type + (f" cannot be decoded: {c.problem}" if c.problem else ""))
            for c in archive.topics.values()]
    for line in columns(rows, right={1}, indent="  "):
        say(line)
    for title, pairs in (("parameters, as the run began", parameters), *about.items()):
        if pairs:
            say(title)
            for line in columns(list(pairs.items()), indent="  "):
                say(line)
    return 0
