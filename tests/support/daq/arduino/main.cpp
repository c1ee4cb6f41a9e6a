// A program of examples/, named by PROGRAM, on a computer.
#include "Arduino.h"
#include "SPI.h"
#include "Wire.h"

SerialPort Serial;
SPIClass SPI;
TwoWire Wire;

void digitalWrite(uint8_t, uint8_t level) { SPI.select(level == LOW); }

#include PROGRAM

int main() {
  setup();
  for (;;) {
    loop();
    usleep(500);
  }
}
