"""Every tolerance of the solvers, and every number below 0.01, in one place.

Those that say which targets are read and which task fits stand in `armkin.inverse.tasks`, which this room imports.

Lengths are in units of the arm's reach, angles in rad, unless a line says otherwise.
"""

# ---- what decides a word: docs/solution.md, "Constants", derives each, and no other does
SOLUTION = 1e-9  # residual up to which joint values solve a target
REACH = 0.1  # movement [rad, reaches] along a component from which on a joint moves on a self-motion manifold
ERROR = 1e-13  # residual that rounding leaves: some hundred operations on numbers of the reach's size
CURVATURE = 100.0  # curvature [1/rad, 1/reach] of the sharpest fold
WEAK = 1e-6  # singular value below which a direction is lost
HIGH_ORDER = 1e-4  # smallest singular value of a posture 1e-9 of the reach off a root of third order, or closer

# ---- what follows from these
ROUNDING_DISTANCE = ERROR / WEAK  # distance [rad, reaches] of joint values that rounding explains
STANDING_DISTANCE = SOLUTION / 100.0  # distance [rad, reaches] of a branch that stands at `near`, which solves it
STILL_TURN = SOLUTION / HIGH_ORDER  # difference [rad, reaches] along a self-motion below which it holds a joint still
MOVED = SOLUTION / WEAK  # share of a component's length below which a joint along it does not move
DRIFT = 2.0 * MOVED  # movement [rad, reaches] along a self-motion of joints too slow to be called free
ACCEPTED = 2.5 * ERROR  # residual of a closed form's candidate that needs no correction
ROUNDING_RESIDUAL = 10.0 * ERROR  # residual of a branch on an edge, or growth of a residual, that is rounding
EQUAL_RESIDUALS = 0.1 * ERROR  # residual below which two residuals count as equal
DOUBLE_VALUE = ERROR**0.5  # singular value below which a root may be double: its two halves cannot be told apart
DOUBLE_DISTANCE = ERROR**0.25  # distance [rad] by which rounding parts candidates at most: at a root of fourth order
FOLD_VALUE = (2.0 * SOLUTION * CURVATURE) ** 0.5  # smallest singular value from which on no component turns
MOVING_VALUE = 2.0 * SOLUTION / REACH  # singular value below which it is asked whether joints can move
GROWTH = SOLUTION / REACH  # growth of the residual per radian along a self-motion
CLOSE_DISTANCE = REACH / 2.0  # distance [rad, reaches] of branches that are one if the posture between them solves

# ---- what is worth correcting
NEARBY = 1e-6  # residual up to which a closed form's candidate is worth correcting
SEED_RESIDUAL = 1e-3  # residual up to which a candidate of a doubted target is worth correcting
HOPELESS = 0.3  # residual of a seed from which on nothing is corrected any more
EQUAL_DECIMALS = 6  # decimals [deg | mm] of motions that count: rounding does not choose between equal ones

# ---- position first: minima of the rotation angle at a position
STATIONARY_SLOPE = 1e-10  # slope of 1 - cos(angle) [1/rad, 1/reach] at a minimum
LEVEL_CURVATURE = 1e-6  # curvature of 1 - cos(angle) below which a minimum may be one of a curve of minima
ONE_MINIMUM = 1e-6  # distance [rad, reaches] of minima, in angle and joints, that are one

# ---- closed forms, relative to the equation's own size
TANGENT_DISCRIMINANT = 1e-7  # discriminant below which the posture between two roots may solve: 3e-4 rad to each
SHARP_DISCRIMINANT = 1e-11  # the same of a wrist of right angles: its roots differ by half a turn of its neighbours
ONE_ROOT = 1e-14  # discriminant below which the middle of two roots misses by less than rounding does
FREE_AMPLITUDE = 1e-18  # squared amplitude below which an equation says nothing about its angle
NEARLY_FREE_AMPLITUDE = 1e-11  # the same where 0.1 rad may miss by less than `SOLUTION`, at a lever of 3 mm/m
TOUCHING_DISTANCE = 1e-4  # distance of complex roots from the real line that may be a double root seen through rounding

# ---- classes of arms
EXACT = 1e-12  # defect up to which axes count as exactly parallel or meeting
NEAR_DEFECT = 1e-3  # defect up to which axes are nearly parallel or meeting: `armkin.inverse.solvers.nearly_special`
COUNTED_DEFECT = 0.015  # defect, of the same kind, where roots of three joints are counted: seeds lead to nearly all
NO_SECOND = 1e-10  # quotient of second and first singular value below which a matrix of two rows is of rank one
BLUR_OF_PAIRS = 3e-8  # distance [rad] by which rounding parts two roots of such a matrix, times the quotient's root
SAME_END = 1e-10  # distance [rad] of places where a branch of seven joints ends that are one place
BESIDE_END = 1e-3  # distance [rad] from a branch's end to the samples on its sides; less where two ends are closer
BESIDE_CROSSING = 1e-6  # distance [rad] from the crossing of a limit, known but for rounding, to where a secant begins
NO_ROOM = 1e-13  # size [rad, rad^2] of what is left at a branch's end that counts as nothing
BEFORE_MERGING = 1e-8  # distance [rad] from where two branches merge to where both are still there
JOINED_SHARE = 1e-3  # distance of two branches just before they merge, in parts of that at the last sample
STEADY_VALUE = 0.05  # singular value above which a branch of an arm near a class continues one of the class
FAR_DISTANCE = 20  # distance [reaches] of a target up to which a sliding arm's branches are known complete

# ---- numeric elimination, lengths in the closed loop's own unit
ELIMINATED = 1e-10  # residual of an answer of an elimination
BESIDE_SPECIAL = 0.01  # defect [rad, scaled length] of axes 6 and 1, parallel or meeting: below, usual pencils are ill
GRAZING = 3e-9  # defect, as BESIDE_SPECIAL, where two roots all but meet: about 1e-9 of the reach
APART_ROOTS = 1e-3  # distance [rad, reaches] from which on roots that seeds lead to are surely two
PAIR_WAY = 1e-4  # half distance [rad, reaches] of two roots below which differences over it would be noise
MOVED_ROOT = 1e-6  # way [rad] that rounding may move a polynomial's root at most, before it is asked in more digits
PAIR_STEP = 1e-8  # last step [rad, reaches] of two roots that are found together: its square is rounding
NO_DETERMINANT = 1e-30  # square of a determinant [reaches a radian] that no step is divided by
LAST_ERROR = 1e-13  # residual up to which Newton's last step is the last
SAME_ANSWER = 1e-6  # distance of answers that are one
EXAMINED_DISTANCE = 1e-2  # distance of answers that are examined for being one
HALFWAY_RESIDUAL = 1e-13  # residual of a point halfway between two answers that makes them one
ILL_INVERSE = 1e4  # norm of the inverse Jacobian from which on an answer is near a singularity
INFINITE_SLIDE = 1e4  # prismatic value that is a root at infinity, seen through rounding
AT_ZERO = 1e-6  # distance of virtual joints from zero up to which they are worth correcting

# ---- arithmetic: what is zero, and steps, each of the file that imports it
TINY = 1e-300  # floor of a divisor: it keeps a quotient finite where the divisor is zero
ROUNDING = 1e-15  # size of what is zero to rounding
NO_SIZE = 1e-12  # length of a vector or coefficient that has no direction, relative to its equation's size
NO_LENGTH = 1e-9  # size [mm] of an arm without lengths
NO_AREA = 1e-9  # determinant of two directions that are one
NO_COEFFICIENT = 1e-9  # size of a matrix that is zero
PARALLEL_SINE = 1e-6  # sine between axes up to which closed forms take them for parallel, cosine for perpendicular
UNDERFLOW = 1e-100  # smallest number whose square is clearly no denormal number
UNDERFLOW_SQUARED = 1e-140  # amplitude below which `UNDERFLOW` stands alone
AT_INFINITY = 1e-9  # divisor of a half tangent below which the angle is half a turn
LEVEL_ROOT = 1e-6  # slope of a cubic at a root that is a double one
MERGING_SLOPE = 1e-4  # slope of a quartic at roots that merge
NO_SLOPE = 1e-18  # square of a slope from which on a Newton step follows it
NO_CUBIC_SLOPE = 1e-30  # square of a slope, as NO_SLOPE, of a cubic, and of a cost
SIGN_FACTOR = 1e-3  # factor on a step's singular value where a sign changes, so that it counts before the one beside it
NAMED_DISTANCE = 1e-6  # distance [rad, reaches] up to which a branch has the name of a formula's
HELD_DIFFERENCE = 1e-9  # difference [rad, mm] up to which a joint counts as held
STEP_VALUE_SQUARED = 1e-10  # square of a singular value from which on a step across a curve uses it
NO_COST = 1e-18  # difference of two costs that are equal
EQUAL_COST = 1e-9  # relative difference of two costs that belong to one minimum
PROBE_SHARE = 1e-6  # share of the way to a curve's next sample, at which it is asked whether the motion gets shorter
SAME_SEED = 1e-4  # distance [rad, reaches] of the answer an arc ends at; residual of one worth a correction
MID_MISS = 1e-4  # error [reaches, rad], at most, of the middle of a cubic that follows a curve of answers
TOUCHING_STEP = 1e-3  # step [rad, reaches] along a curve, below which it passes a plane on which it is not found
SHORTEST_ARC = 1e-6  # step [rad, reaches] along a curve of answers, below which the curve is given up
LAST_STEP = 1e-9  # length [rad, reaches] of a step of the descent after which none is worth while
SHORTENED_SHARE = 0.005  # shortest share of a step that is tried
MIN_DAMPING = 1e-12  # smallest damping of Levenberg-Marquardt steps
EQUAL_BUT_ROUNDING = 1e-14  # relative change of a cost that rounding makes
GAINS_NOTHING = 1e-17  # relative gain in cost of a step that is the last
PAIRED_PART = 1e-4  # imaginary part [rad] of a double root's halves
SAME_ROOT = 1e-4  # distance of hidden angles that may be one root
UPRIGHT = 1e-4  # imaginary part [rad] of a root that was real
STRAY_DISTANCE = 1e-3  # distance [rad, scaled length] that the pose moves a root: one that moves farther is another
SAME_KEY = 1e-5  # distance along a key of answers that may be one
BLURRED_ROOT = 1e-5  # distance [rad, scaled length] of a guess from its root, above which the root is blurred
CLOSE_RESIDUAL = 1e-5  # residual of a posture that may yet become an answer
RANK_VALUE = 1e-9  # relative singular value below which it is zero: to the largest one
ERROR_FLOOR = 1e-16  # floor of an error: it keeps its logarithm finite
NULL_VALUE = 1e-11  # relative singular value of a pencil's null vectors
STALE_SHARE = 1e-3  # share of the last residual above which polishing stands still
ANSWERED = 1e-12  # residual of an answer that was moved onto its target
NO_RESIDUAL = 1e-14  # residual below which no answer comes
MIN_VALUE = 1e-6  # singular value below which no branch is steady
WEAK_PIVOT = 1e-6  # pivot [1] up to which an elimination may lose more than six digits
NOISE = 1e-13  # relative size of noise that makes a matrix regular
LEFT_OUT_VALUE = 1e-10  # singular value that a step of least norm leaves out
CONVERGING = 1e-11  # residual below which a step has to halve it
DECIMAL = 4e-16  # relative distance of a number from a decimal one that it is printed as
FLOAT32 = 2.0**-24  # relative rounding of a number in single precision: half a unit of its last place
FEW_DIGITS = 1e-4  # entry of a rounded rotation below which it does not tell to how many digits
SHORTEST_STEP = 1e-4  # shortest step [rad, reaches] along a curve of a self-motion
OFF_CURVE_RESIDUAL = 1e-6  # residual above which the joints move no farther
CROSSING_VALUE = 2e-4  # second smallest singular value below which another curve may cross
GRADIENT_WAY = 1e-5  # step [rad, reaches] of the gradient's differences
LEVEL_VALUE = 1e-9  # least curvature that a step is divided by
UPHILL_CURVATURE = 1e-6  # curvature that rounding may hide
FLAT_GRADIENT = 1e-8  # largest component of the gradient at a minimum, as a share of the distance and its square
EQUAL_ROOTS = 1e-7  # distance [rad] of roots that may be one that two solutions share
APART_VECTORS = 1e-3  # sine between two vectors of such a root; those of one with one vector were 1.4e-4 apart at most
OWN_ROOT = 1e-6  # distance [rad, scaled length], at most, of a root from the answer that it stands for
LONE_DISTANCE = 1e-3  # distance from which on a root is no half of a double one
CONVERGED = 1e-14  # residual that further steps cannot be expected to lower
NO_PRODUCT = 1e-5  # defect from which a vector is surely that of no solution; those of some 36 arms had 1.3e-7 at most
TWIN_ROOTS = 1e-4  # distance of two roots that may be one double root: rounding parts them by its own root
REAL_PAIR = 1e-8  # sine between two roots' vectors times their distance, above which they are not real; rounding: 2e-10
END_ERROR = 1e-3  # error [rad, scaled length], at most, of end joints that follow from the middle ones
PARALLEL_SLIDES = 1e-12  # sine between axes 1 and 3 below which joint 1 is free
COPLANAR_VALUE = 1e-12  # smallest singular value of the slides' directions below which they are coplanar
MERGED_SLIDES = 3e-15  # square of the sine of half the angle between the two values of q2 below which they are one
NEARLY_COPLANAR = 1e-5  # smallest singular value and sine below which both happen at once, to rounding
FOLD_WAY = 1e-3  # step [rad, reaches] of a fold's second difference, whose rounding is 1e-10
FOLD_BEND = 1e-3  # curvature [1/rad, 1/reach] above which a singular posture is a fold; along a self-motion it is zero
BLUR_DEFECT = 1e-9  # distance from a class that rounding alone explains
STALLED_RESIDUAL = 1e-6  # residual from which a step that brings hardly anything tells that no further one will
ARRIVED_STEP = 1e-9  # step [rad, reaches] that ends Newton's method: its square is below rounding
SMOOTH_ERROR = 1e-5  # error of polynomials off their curve, at most, as a share of a span
MIN_COST = 1e-30  # floor of a cost that shares are taken of
LOOSE_LEVER = 1e-12  # squared length across a joint [1, reaches] below which it may be free: rounding of a double root
LOOSE_DOUBLE_LEVER = 1e-9  # the same at a root of fourth order, of which rounding leaves the fourth root
SHAKE_DISTANCE = 1e-4  # distance [reaches, rad] by which a target is moved to where nothing is free
# Four passes without a move, by other pencils: a moved pose has no self-motion, and what is settled there is not called
# complete; two passes settle 98.7 % of a PRRRRP's random poses, four 99.8 %. Of 64 poses of right-angled arms that four
# leave open a move of 1e-6 settles 0, 1e-5 6, 1e-4 26, 1e-3 37. Why 1e-6 stands after 1e-5 is not known.
SHAKES = (0.0, 0.0, 0.0, 0.0, 1e-5, 1e-5, 1e-6, 1e-4, 1e-3)  # way that each pass of an elimination moves the pose
SLOW_DISTANCE = 1e-3  # distance [rad, scaled length] of candidates that have not converged and take more steps
FIRST_POINT = 3e-6  # first point, as a share of a span, at which a residual is compared
