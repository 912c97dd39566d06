"""`armkin ports`."""

from armkin.cli.parsing.options import Json
from armkin.cli.printing import output, render


def ports(json: Json = False) -> None:
    """Serial ports of this computer, Arduinos first."""
    from dataclasses import asdict

    from armkin.board.ports import list_ports

    ports = list_ports()
    with output.destination(None) as write:
        if json:
            write(render.to_json({"ports": [asdict(port) for port in ports]}) + "\n")
            return
        rows = [[port.device, port.board or port.adapter, port.description] for port in ports]
        write(render.table(rows, left_aligned=(0, 1, 2), indent="") + "\n" if rows else "")
    if not rows:
        output.warn("no serial port found: is the board plugged in, with a cable that carries data?")
