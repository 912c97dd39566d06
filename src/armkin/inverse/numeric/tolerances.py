"""Every tolerance of the solvers, in one place.

Lengths are in units of the arm's reach, angles in rad, unless a line says otherwise.
"""

# ---- what a solution is
SOLUTION = 1e-9  # residual up to which joint values solve a target
REACH = 0.1  # [rad, reaches] a component along which a joint moves by this or more is a self-motion manifold
ACCEPTED = 2.5e-13  # residual of a closed form's candidate that needs no correction
NEARBY = 1e-6  # residual up to which a closed form's candidate is worth correcting
SEED = 1e-3  # residual up to which a candidate of a doubtful target is
HOPELESS = 0.3  # residual of a seed from which nothing is corrected any more

# ---- when two are one
SAME = 1e-7  # distance of joint values that rounding explains
HAIR = 0.05  # branches this close are one if the posture between them solves the target, too
BESIDE = 0.2  # postures of self-motions this close are asked whether they are one
TURNED = 1e-5  # joints that a self-motion holds differ by less along it
DRIFT = 2e-3  # and those that it moves, but too slowly to be called free
THERE = 1e-11  # [rad, reaches] a branch this close to `near` is there: `near` solves the target, too
EQUAL = 6  # decimals [deg | mm] of motions that count: rounding does not choose between equal ones

# ---- how singular
HIGH = 1e-4  # smallest singular value of a posture 1e-9 of the reach off a root of third order, or closer
WEAK = 1e-6  # smallest singular value below which a branch may be part of a self-motion
FOLDED = 4.5e-4  # and from which on no component holds a turning point: s^2 = 2 SOLUTION times a curvature of 100
MOVING = 3e-8  # and below which it is asked whether it is
DOUBLE = 3e-7  # and below which it counts as a double root: arithmetic cannot tell its two halves apart
CLUSTER = 0.02  # candidates this close may be one root of third or fourth order

# ---- closed forms, relative to the equation's own size
TANGENT = 1e-7  # discriminant below which the posture between two roots may solve the target: 3e-4 rad to each
SHARP = 1e-11  # the same of a wrist of right angles, whose two roots differ by half a turn of its neighbours
ONE_ROOT = 1e-14  # discriminant below which the middle of two roots misses by less than rounding does
FREE = 1e-18  # squared amplitude below which an equation says nothing about its angle
NEARLY_FREE = 1e-11  # and below which 0.1 rad of it may miss by less than `SOLUTION`, at a lever of 3 mm a metre
TOUCHING = 1e-4  # complex roots this close to the real line may be a double root seen through rounding

# ---- classes of arms
EXACT = 1e-12  # axes parallel or meeting to this count as exactly so
NEAR = 1e-3  # and to this as nearly so: `armkin.inverse.nearly_special`
STEADY = 0.05  # singular value above which a branch of an arm near a class continues one of the class
FAR = 20  # reaches that a target of a sliding arm may be away for its branches to be known complete

# ---- numeric elimination, lengths in the closed loop's own unit
ELIMINATED = 1e-10  # residual of an answer
GRAZING = 3e-9  # the same where two roots all but meet: about 1e-9 of the reach
ALIKE = 1e-6  # answers closer than this are one
EXAMINED = 1e-2  # answers closer than this are examined
HALFWAY = 1e-13  # residual of a point halfway between two answers that makes them one
ILL = 1e4  # norm of the inverse Jacobian from which on an answer is near a singularity
INFINITE = 1e4  # a prismatic value that is a root at infinity, seen through rounding
AT_ZERO = 1e-6  # virtual joints closer to zero than this are worth correcting
