"""Every tolerance of the solvers, and every number below 0.01, in one place.

Those that say which targets are read and which task fits stand in `armkin.inverse.tasks`, which this room imports.

Lengths are in units of the arm's reach, angles in rad, unless a line says otherwise.
"""

# ---- what decides a word: docs/solution.md, "Constants", derives each, and no other does
SOLUTION = 1e-9  # residual up to which joint values solve a target
REACH = 0.1  # [rad, reaches] a component along which a joint moves by this or more is a self-motion manifold
ERROR = 1e-13  # residual that rounding leaves: some hundred operations on numbers of the reach's size
CURVATURE = 100.0  # [1/rad, 1/reach] of the sharpest fold
WEAK = 1e-6  # singular value below which a direction is lost
HIGH = 1e-4  # smallest one of a posture 1e-9 of the reach off a root of third order, or closer

# ---- what follows from these
SAME = ERROR / WEAK  # distance of joint values that rounding explains
THERE = SOLUTION / 100.0  # [rad, reaches] a branch this close to `near` is there: `near` solves the target, too
TURNED = SOLUTION / HIGH  # joints that a self-motion holds differ by less along it
MOVED = SOLUTION / WEAK  # of the way: a joint that moves less along a component does not move
DRIFT = 2.0 * MOVED  # joints that move along a self-motion, but too slowly to be called free
ACCEPTED = 2.5 * ERROR  # residual of a closed form's candidate that needs no correction
CLOSED = 10.0 * ERROR  # of a branch on an edge that needs none; growth of a residual that is rounding
EQUAL_RESIDUALS = 0.1 * ERROR  # residuals below this are equal
DOUBLE = ERROR**0.5  # singular value below which a root may be double: arithmetic cannot tell its two halves apart
DOUBLE_ROOT = ERROR**0.25  # [rad] how far rounding parts candidates at most: those of a root of fourth order
FOLDED = (2.0 * SOLUTION * CURVATURE) ** 0.5  # smallest singular value from which on no component holds a turning point
MOVING = 2.0 * SOLUTION / REACH  # and below which it is asked whether joints can move
GROWTH = SOLUTION / REACH  # residual a radian along a self-motion
CLOSE_BY = REACH / 2.0  # branches this close are one if the posture between them solves the target, too

# ---- what is worth correcting
NEARBY = 1e-6  # residual up to which a closed form's candidate is worth correcting
SEED = 1e-3  # residual up to which a candidate of a doubted target is
HOPELESS = 0.3  # residual of a seed from which nothing is corrected any more
EQUAL = 6  # decimals [deg | mm] of motions that count: rounding does not choose between equal ones

# ---- position first: minima of the rotation angle at a position
STATIONARY = 1e-10  # slope of 1 - cos(angle) [1/rad, 1/reach] at a minimum
LEVEL_CURVATURE = 1e-6  # its curvature below which a minimum may be one of a curve of such
ONE_MINIMUM = 1e-6  # [rad, reaches] minima this close, in angle and joints, are one

# ---- closed forms, relative to the equation's own size
TANGENT = 1e-7  # discriminant below which the posture between two roots may solve the target: 3e-4 rad to each
SHARP = 1e-11  # the same of a wrist of right angles, whose two roots differ by half a turn of its neighbours
ONE_ROOT = 1e-14  # discriminant below which the middle of two roots misses by less than rounding does
FREE = 1e-18  # squared amplitude below which an equation says nothing about its angle
NEARLY_FREE = 1e-11  # and below which 0.1 rad of it may miss by less than `SOLUTION`, at a lever of 3 mm a metre
TOUCHING = 1e-4  # complex roots this close to the real line may be a double root seen through rounding

# ---- classes of arms
EXACT = 1e-12  # axes parallel or meeting to this count as exactly so
NEAR = 1e-3  # and to this as nearly so: `armkin.inverse.solvers.nearly_special`
NEARLY_SPECIAL = 0.015  # the same where the roots of three joints are counted: seeds lead to nearly all of them
NO_SECOND = 1e-10  # second singular value over the first below which a matrix of two rows is of rank one
BLUR_OF_PAIRS = 3e-8  # [rad] how far rounding parts two roots of such a matrix, times the square root of that quotient
SAME_END = 1e-10  # [rad] places this close where a branch of seven joints ends are one
BESIDE_END = 1e-3  # [rad] from such a place, where samples tell what is on its sides; less where two are closer
BESIDE_CROSSING = 1e-6  # [rad] from where a limit is crossed, known but for rounding, to where a secant begins
NO_ROOM = 1e-13  # [rad, rad^2] what is left there that is nothing
BEFORE_MERGING = 1e-8  # [rad] from where two branches merge to where they are still there
JOINED = 1e-3  # and how close two are just before they merge, in parts of what lay between them at the last sample
STEADY = 0.05  # singular value above which a branch of an arm near a class continues one of the class
FAR = 20  # reaches that a target of a sliding arm may be away for its branches to be known complete

# ---- numeric elimination, lengths in the closed loop's own unit
ELIMINATED = 1e-10  # residual of an answer
BESIDE_SPECIAL = 0.01  # [rad, scaled length] axes 6 and 1 this near parallel or meeting: the usual pencils are ill
GRAZING = 3e-9  # the same where two roots all but meet: about 1e-9 of the reach
APART_ROOTS = 1e-3  # [rad, reaches] roots that seeds lead to are surely two if they are farther apart
PAIR_WAY = 1e-4  # [rad, reaches] half of what lies between two roots, below which differences over it would be noise
PAIR_SETTLED = 1e-8  # [rad, reaches] the last step of two roots that are found together: its square is rounding
NO_DETERMINANT = 1e-30  # square of a determinant [reaches a radian] that no step is divided by
LAST_ERROR = 1e-13  # of Newton's last step
ALIKE = 1e-6  # answers closer than this are one
EXAMINED = 1e-2  # answers closer than this are examined
HALFWAY = 1e-13  # residual of a point halfway between two answers that makes them one
ILL = 1e4  # norm of the inverse Jacobian from which on an answer is near a singularity
INFINITE = 1e4  # a prismatic value that is a root at infinity, seen through rounding
AT_ZERO = 1e-6  # virtual joints closer to zero than this are worth correcting

# ---- arithmetic: what is zero, and steps, each of the file that imports it
TINY = 1e-300  # keeps a quotient finite where its divisor is zero
ROUNDING = 1e-15  # what is that small is zero to rounding
NO_SIZE = 1e-12  # a vector or coefficient that short has no direction, relative to its equation's size
NO_LENGTH = 1e-9  # [mm] the size of an arm without lengths
NO_AREA = 1e-9  # determinant of two directions that are one
NO_COEFFICIENT = 1e-9  # a matrix that small is zero
PARALLEL = 1e-6  # sine between axes up to which a closed form takes them for parallel, cosine for perpendicular ones
UNDERFLOW = 1e-100  # its square is no denormal number
UNDERFLOW_SQUARED = 1e-140  # amplitude below which `UNDERFLOW` stands alone
AT_INFINITY = 1e-9  # divisor of a half tangent below which the angle is half a turn
LEVEL_ROOT = 1e-6  # slope of a cubic at a root that is a double one
MERGING = 1e-4  # slope of a quartic at roots that merge
NO_SLOPE = 1e-18  # square of a slope from which on a Newton step follows it
NO_CUBIC_SLOPE = 1e-30  # the same of a cubic, and of a cost
RATHER = 1e-3  # by how much a change of sign counts more than a step beside it
NAMED = 1e-6  # [rad, reaches] a branch this close to a formula's has its name
HELD = 1e-9  # [rad, mm] a joint that is held differs by less
ACROSS = 1e-10  # square of a singular value from which on a step across a curve uses it
NO_COST = 1e-18  # costs that differ by less are equal
EQUAL_COST = 1e-9  # share by which costs of one minimum differ
PROBE = 1e-6  # of the way to the next sample of a curve, where it is asked whether the motion falls
SAME_SEED = 1e-4  # [rad, reaches] an arc ends at the answer this close by; residual of one worth a correction
ROUGHLY = 1e-4  # [reaches, rad] what the middle of a cubic that follows a curve of answers misses at most
SHORTEST_ARC = 1e-6  # [rad, reaches] step along a curve of answers, below which it is given up
LAST_STEP = 1e-9  # [rad, reaches] a step of the descent after which none is worth while
SHORTENED = 0.005  # shortest part of a step that is tried
LEAST_DAMPING = 1e-12  # of Levenberg-Marquardt steps
EQUAL_BUT_ROUNDING = 1e-14  # share by which rounding changes a cost
GAINS_NOTHING = 1e-17  # share of a cost that a last step gains
PAIRED = 1e-4  # imaginary part [rad] of a double root's halves
SAME_ROOT = 1e-4  # distance of hidden angles that may be one root
UPRIGHT = 1e-4  # imaginary part [rad] of a root that was real
STRAY = 1e-3  # [rad, scaled length] a root that the pose itself moves farther is another one
SAME_KEY = 1e-5  # distance along a key of answers that may be one
BLURRED_ROOT = 1e-5  # [rad, scaled length] a guess farther off has a blurred root
CLOSE_RESIDUAL = 1e-5  # residual of a posture that may yet become an answer
RANK = 1e-9  # singular values below this, relative to the largest, are zero
ERROR_FLOOR = 1e-16  # keeps the logarithm of an error finite
NULL = 1e-11  # relative singular value of a pencil's null vectors
STALE = 1e-3  # share of the last residual above which polishing stands still
ANSWERED = 1e-12  # residual of an answer that was moved onto its target
ROUNDED_ANSWER = 1e-14  # residual that no answer falls below
AT_LEAST = 1e-6  # singular value below which no branch is steady
NOISE = 1e-13  # relative size of noise that makes a matrix regular
LEFT_OUT = 1e-10  # singular value that a step of least norm leaves out
CONVERGING = 1e-11  # residual below which a step has to halve it
DECIMAL = 4e-16  # relative distance of a number from a decimal one that it is printed as
FLOAT32 = 2.0**-24  # of a number in single precision: half a unit of its last place
FEW_DIGITS = 1e-4  # entry of a rounded rotation below which it does not tell to how many digits
SHORTEST_STEP = 1e-4  # [rad, reaches] along a curve of a self-motion
OFF_CURVE = 1e-6  # residual above which the joints move no farther
CROSSING = 2e-4  # second smallest singular value below which another curve may cross
GRADIENT_WAY = 1e-5  # [rad, reaches] of the gradient's differences
LEVEL_VALUE = 1e-5  # least curvature that a step is divided by
UPHILL = 1e-6  # curvature that rounding may hide
FLAT_GRADIENT = 1e-8  # largest component of the gradient at a minimum; cost in squared reaches
EQUAL_ROOTS = 1e-7  # [rad] roots no further apart may be one that two solutions share
APART_VECTORS = 1e-3  # sine between two vectors of such a root; those of one with one vector were 1.4e-4 apart at most
OWN_ROOT = 1e-6  # [rad, scaled length] how far a root may be off the answer that it stands for
ALONE = 1e-3  # distance from which on a root is no half of a double one
CONVERGED = 1e-14  # a residual that further steps cannot be expected to lower
NO_PRODUCT = 1e-5  # defect from which a vector is surely that of no solution; those of some 36 arms had 1.3e-7 at most
TWIN_ROOTS = 1e-4  # distance of two roots that may be one double root: rounding parts them by its own root
REAL_PAIR = 1e-8  # sine between two roots' vectors times their distance, above which they are not real; rounding: 2e-10
FOLLOWS = 1e-3  # [rad, scaled length] end joints that follow from the middle ones are not farther off than that
PARALLEL_SLIDES = 1e-12  # sine between axes 1 and 3 below which joint 1 is free
COPLANAR = 1e-12  # smallest singular value of the slides' directions below which they are coplanar
MERGED_SLIDES = 3e-15  # square of the sine of half the angle between the two values of q2 below which they are one
NEARLY_COPLANAR = 1e-5  # smallest singular value and sine below which both happen at once, to rounding
FOLD_WAY = 1e-3  # [rad, reaches] of the second difference: its rounding is 1e-10
BENT = 1e-3  # curvature of a fold; along a self-motion it is zero
BLURRED = 1e-9  # distance from a class that rounding alone explains
STALLED = 1e-6  # residual from which a step that brings hardly anything tells that no further one will
ARRIVED = 1e-9  # [rad, reaches] a step that ends them: its square is below rounding
SMOOTH = 1e-5  # of a span: how far polynomials may be off their curve
LEAST_COST = 1e-30  # a cost that shares are taken of is no smaller
LOOSE = 1e-12  # squared length across a joint [1 or reaches] below which it may be free: of a double root of the next
LOOSE_DOUBLE = 1e-9  # rounding leaves the root; the same where that root is one of fourth order, and leaves the fourth
SHAKE = 1e-4  # [reaches, rad] by how much a target is moved to where nothing is free
SHAKES = (0.0, 0.0, 0.0, 0.0, 1e-5, 1e-5, 1e-6, 1e-4, 1e-3)  # how far each pass of an elimination moves the pose
SLOWLY = 1e-3  # [rad, scaled length] candidates this close that have not converged take more steps
FINEST = 3e-6  # of a span: the first point at which a residual is compared
