"""A page for an arm: see it, choose the branch, write a program, move the motors.

server.py   HTTP on 127.0.0.1: files, events, actions; who may ask is decided in guard.py
tabs.py     the open pages: which one holds control, what each has still to hear
desk.py     one arm, one page: every action by its name
scene.py    what the page draws: links, bodies, limits
look.py     one pose or one target: branches, limits, pulses
static/     the page itself; static/vendor/three is three.js, byte for byte
"""
