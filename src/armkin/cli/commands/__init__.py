"""One file a command; each parses, calls, renders and exits."""

# Name, and the first sentence of the function's docstring (a test compares the two).
COMMANDS = {
    "fk": "Where the tool is for given joint values.",
    "ik": "All joint values that reach a target.",
    "pulses": "Motor pulses from home to a pose.",
    "send": "Move the arm.",
    "path": "Plan a path through space, and move along it.",
    "status": "Where the board says that the arm stands.",
    "home": "Find the limit switches, and with them the position.",
    "stop": "Stop the arm along its path.",
    "grip": "Open or close the gripper.",
    "jog": "Move one joint at a constant speed, for a short time.",
    "ports": "Serial ports of this computer, Arduinos first.",
    "setup": "A board's settings against the robot file.",
    "relax": "Switch bus servos off, to move the arm by hand and read it.",
    "zero": "Record where the zero of bus servos is.",
    "workspace": "Where the tip can reach: bounds, volume, a cloud of points.",
    "plot": "A picture of the arm.",
    "teach": "A page in the browser: see the arm, choose a branch, send it.",
    "robots": "The robots that come with armkin, and what each can do.",
    "new": "A robot file from a DH table, commented.",
    "info": "What a robot file says, checked.",
    "calibrate": "A corrected robot file from measured tips.",
    "import": "A robot file from a URDF.",
    "export": "The arm in other words: URDF, JSON, C, JavaScript, HTML.",
    "schema": "JSON Schema of robot files, for editors.",
}
