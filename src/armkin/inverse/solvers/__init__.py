"""Which class an arm belongs to, and the classes that are no closed form of their own.

solver_of_arm.py           the classes, in the order in which they are asked
nearly_special.py          all but one of the closed forms: its branches, corrected on the true arm
position_pencil.py         three turning joints near one: all four roots, where those corrections do not lead to four
pairs.py                   others near one: both branches of a fold at once, where those corrections leave one open
tool_axis.py               five joints, the tool's position and z axis: a class for poses and a virtual joint
choose_redundant_joint.py  one joint more than the task asks for: which one is redundant
general.py                 every other arm of up to six joints
"""
