// What main.cpp needs of a sensor, and registers on SPI.
#pragma once
#include <Arduino.h>
#include <SPI.h>

const uint8_t CHIP_SELECT = 17;

struct Scan {
  int32_t counts[3];
  int16_t centidegrees;  // -32768: not known
  uint32_t us;           // of the clock of the node
};

struct Identity {
  const char *product;
  float scale;  // m/s2 per count
  uint32_t millihertz;
};

// Wait for the sensor and let it measure.
Identity startSensor();

// Take the next scan out of the memory of the sensor, if there is one; add those that were lost before it to `lost`.
bool nextScan(Scan &scan, uint32_t &lost);

static void transfer(const SPISettings &settings, uint8_t command, uint8_t *content, size_t n) {
  SPI.beginTransaction(settings);
  digitalWrite(CHIP_SELECT, LOW);
  SPI.transfer(command);
  for (size_t k = 0; k < n; k++)
    content[k] = SPI.transfer(content[k]);
  digitalWrite(CHIP_SELECT, HIGH);
  SPI.endTransaction();
}
