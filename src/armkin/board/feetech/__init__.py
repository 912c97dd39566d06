"""Bus servos: Feetech STS3215 and its kin.

packet.py           packets on the bus
registers.py        a servo's registers
bus.py              questions, asked again until they are answered
feetech_machine.py  an arm of them; servo_gripper.py: its gripper
lerobot.py          zeros and limits from LeRobot's calibration file
"""
