// The armkin firmware. Everything is under src/; this file is here so that the Arduino IDE opens and builds the folder.
//
// Tools > Board: "Arduino Uno" is a CNC Shield V3, "Arduino Mega 2560" a RAMPS 1.4. For servos on a bare Uno change src/board.h.
// There is no setup() and no loop(): src/avr/main.c has its own main(), so that the Arduino core's timer interrupts stay out.
