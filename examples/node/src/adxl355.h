// ADXL355 on SPI: 1000 scans per second, low-pass filter at 250 Hz, 2 g. 32 scans wait in its memory.
#pragma once
#include "sensor.h"

namespace adxl355 {
const uint32_t PERIOD_US = 1000;
const uint8_t ID = 0x00, STATUS = 0x04, FIFO_ENTRIES = 0x05, TEMPERATURE = 0x06, FIFO_DATA = 0x11;
const uint8_t FILTER = 0x28, RANGE = 0x2C, POWER = 0x2D, RESET = 0x2F;
const uint8_t FIFO_OVERRUN = 0x04, IS_X = 0x01, IS_EMPTY = 0x02;
const SPISettings SETTINGS(5000000, MSBFIRST, SPI_MODE0);

inline void read(uint8_t address, uint8_t *content, size_t n) {
  memset(content, 0, n);
  transfer(SETTINGS, (uint8_t)(address << 1 | 1), content, n);
}

inline void write(uint8_t address, uint8_t value) { transfer(SETTINGS, (uint8_t)(address << 1), &value, 1); }

inline int32_t axis(const uint8_t *entry) {  // 20 bits, the highest first
  uint32_t bits = (uint32_t)entry[0] << 24 | (uint32_t)entry[1] << 16 | (uint32_t)(entry[2] & 0xF0) << 8;
  return (int32_t)bits / 4096;
}

inline int16_t centidegrees() {
  uint8_t raw[2];
  read(TEMPERATURE, raw, 2);
  return (int16_t)(2500 - (((raw[0] & 0x0F) << 8 | raw[1]) - 1885) * 100 / 9.05f);
}
}  // namespace adxl355

inline Identity startSensor() {
  using namespace adxl355;
  uint8_t id = 0;
  while (read(ID, &id, 1), id != 0xAD)
    delay(100);
  write(RESET, 0x52);
  delay(10);
  write(RANGE, 0x01);   // 2 g
  write(FILTER, 0x02);  // 1000 Hz
  write(POWER, 0x00);   // measure
  return {"adxl355", 9.80665f / 256000, 1000000};
}

inline bool nextScan(Scan &scan, uint32_t &lost) {
  using namespace adxl355;
  static uint32_t last = 0;
  uint8_t status, entries, content[9];
  read(FIFO_ENTRIES, &entries, 1);
  uint32_t waiting = entries / 3, now = micros();
  if (waiting == 0)
    return false;
  read(STATUS, &status, 1);
  uint32_t passed = (now - last) / PERIOD_US;
  uint32_t missing = !(status & FIFO_OVERRUN) || !last ? 0 : passed > waiting ? passed - waiting : 1;
  lost += missing;
  read(FIFO_DATA, content, 9);
  if (content[2] & IS_EMPTY || !(content[2] & IS_X))
    return false;
  for (int k = 0; k < 3; k++)
    scan.counts[k] = axis(content + 3 * k);
  last = now - (waiting - 1) * PERIOD_US;
  scan.us = scanTime(last, 1 + missing, PERIOD_US);
  scan.centidegrees = centidegrees();
  return true;
}
