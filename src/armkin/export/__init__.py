"""Exports an arm to other formats.

conventions.py       robot files in another convention: screws, DH standard or modified
urdf_writer.py       URDF, with limits, speeds and visuals
arm_json.py          plain numbers for JSON
elimination_data.py  constants of the general elimination, for C and JavaScript
c/                   C99 that needs only libm
js/                  an ES module without imports
"""
