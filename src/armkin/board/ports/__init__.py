"""Bytes to and from a board.

port.py         what every port can do
serial_port.py  serial ports, and the lock that keeps two programs from one arm
socket_port.py  the Unix socket of a program on this computer
"""

from armkin.board.ports.port import BAUD, SIM, Port
from armkin.board.ports.serial_port import Found, SerialPort, holder, holder_rate, list_ports, note_path
from armkin.board.ports.socket_port import SocketPort, is_socket

__all__ = [
    "BAUD",
    "SIM",
    "Found",
    "Port",
    "SerialPort",
    "SocketPort",
    "holder",
    "holder_rate",
    "is_socket",
    "list_ports",
    "note_path",
]
