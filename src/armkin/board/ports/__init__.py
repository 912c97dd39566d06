"""Ports: bytes to and from a board.

port.py         the interface of every port
scene_note.py   the scene that a port was last used with
port_lock.py    the lock that keeps two programs from one arm
port_notes.py   small files beside the lock
logged_port.py  a port whose bytes are logged
serial_port.py  serial ports
boot_loader.py  leaving the boot loader that opening a port may start
socket_port.py  the Unix socket of a program on this computer
"""

from armkin.board.ports.boot_loader import leave_boot_loader
from armkin.board.ports.logged_port import LOG, with_log
from armkin.board.ports.port import BAUD, SIM, Port
from armkin.board.ports.port_lock import ask_to_stop, holder_pid, holder_rate, note_path, record_path
from armkin.board.ports.port_notes import read_note, remove_note, write_note
from armkin.board.ports.serial_port import Found, SerialPort, list_ports
from armkin.board.ports.socket_port import SocketPort, is_socket

__all__ = [
    "BAUD",
    "LOG",
    "SIM",
    "Found",
    "Port",
    "SerialPort",
    "SocketPort",
    "ask_to_stop",
    "holder_pid",
    "holder_rate",
    "is_socket",
    "leave_boot_loader",
    "list_ports",
    "note_path",
    "read_note",
    "record_path",
    "remove_note",
    "with_log",
    "write_note",
]
