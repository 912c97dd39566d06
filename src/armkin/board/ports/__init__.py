"""Bytes to and from a board.

port.py         what every port can do
serial_port.py  serial ports, and the lock that keeps two programs from one arm
"""

from armkin.board.ports.port import BAUD, SIM, Port
from armkin.board.ports.serial_port import Found, SerialPort, holder, list_ports, note_path

__all__ = ["BAUD", "SIM", "Found", "Port", "SerialPort", "holder", "list_ports", "note_path"]
