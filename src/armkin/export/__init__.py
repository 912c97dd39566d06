"""An arm in other words.

c/  C99 that needs nothing but libm
"""
