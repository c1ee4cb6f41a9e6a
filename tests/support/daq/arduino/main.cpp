// A sketch, named by SKETCH, as a program on a computer: its serial port is the standard output.
#include "Arduino.h"
#include "Wire.h"

SerialPort Serial;
TwoWire Wire;

#include SKETCH

int main() {
  setup();
  for (;;) {
    loop();
    usleep(500);
  }
}
