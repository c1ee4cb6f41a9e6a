// A node of modalwatch: its frames are in modalwatch_node.h, its sensor is chosen in platformio.ini.
#include <Arduino.h>
#include <SPI.h>

#include "modalwatch_node.h"
#ifdef SENSOR_IIS3DWB
#include "iis3dwb.h"
#else
#include "adxl355.h"
#endif

const char SERIAL_NUMBER[] = "N0000001";  // of each node its own, up to 12 characters

static Identity identity;
static uint8_t frame[MW_LONGEST];

static void introduce() {
  Serial.write(frame, mw_hello(identity.product, SERIAL_NUMBER, 7, identity.scale, identity.millihertz, frame));
}

void setup() {
  Serial.begin(460800);
  pinMode(CHIP_SELECT, OUTPUT);
  digitalWrite(CHIP_SELECT, HIGH);
  SPI.begin();
  identity = startSensor();
}

void loop() {
  static uint32_t counter = 0, asked = 0;
  static bool sending = false;
  while (Serial.available() > 0) {
    int command = mw_hear((uint8_t)Serial.read(), &asked);
    if (command == MW_WHO || command == MW_START)
      introduce();  // with its own rate, whatever the host has asked for
    if (command == MW_START || command == MW_STOP)
      sending = command == MW_START;
  }
  Scan scan;
  while (nextScan(scan, counter)) {
    size_t n = mw_scan(counter++, scan.us, scan.counts, scan.centidegrees, frame);
    if (sending && Serial.availableForWrite() >= (int)n)  // never waits for the port
      Serial.write(frame, n);
  }
}
