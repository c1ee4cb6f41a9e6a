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

// Time of a scan [us] from when it was found, which is up to a period and a turn of the loop late: it follows the mean.
static uint32_t scanTime(uint32_t found, uint32_t steps, float periodUs) {
  static uint32_t last = 0;
  static float rest = 0;
  float step = steps * periodUs, error = (float)(int32_t)(found - last) - step;
  if (last == 0 || error > 5000 || error < -5000) {
    rest = 0;
    return last = found;
  }
  rest += step + error / 64;
  uint32_t whole = (uint32_t)rest;
  rest -= whole;
  return last += whole;
}

static void transfer(const SPISettings &settings, uint8_t command, uint8_t *content, size_t n) {
  SPI.beginTransaction(settings);
  digitalWrite(CHIP_SELECT, LOW);
  SPI.transfer(command);
  for (size_t k = 0; k < n; k++)
    content[k] = SPI.transfer(content[k]);
  digitalWrite(CHIP_SELECT, HIGH);
  SPI.endTransaction();
}
