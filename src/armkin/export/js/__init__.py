"""An arm as an ES module without imports.

es_module.py       the module: data, recorded formulas, and the parts
js_elimination.py  the general elimination: constants as typed arrays
parts/             what is the same for all arms, in JavaScript
"""
