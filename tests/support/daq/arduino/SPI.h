// An SPI bus with both sensors of examples/node on it: which one answers depends on the build.
//
// ADXL355: scan k, every ms, is (k, -k, 3 k). IIS3DWB: sample n, at 26.667 kHz, is 1000 + 500 sin(100 Hz), -1000 and
// 500 sin(900 Hz). Their memories are as long as this program needs.
#pragma once
#include <math.h>

#include "Arduino.h"

enum { MSBFIRST, SPI_MODE0 };
struct SPISettings {
  SPISettings(uint32_t, int, int) {}
};

class SPIClass {
 public:
  void begin() {}
  void beginTransaction(const SPISettings &) {}
  void endTransaction() {}
  void select(bool low) { at_ = low ? 0 : -1; }
  uint8_t transfer(uint8_t value) {
    if (at_++ == 0) {
      command_ = value;
      return 0;
    }
    return wide() ? iis3dwb(value, at_ - 2) : adxl355(value, at_ - 2);
  }

 private:
  static bool wide() {
#ifdef SENSOR_IIS3DWB
    return true;
#else
    return false;
#endif
  }
  uint64_t waiting(double hertz) { return start_ ? (uint64_t)((host_us() - start_) * 1e-6 * hertz) - next_ : 0; }
  uint8_t adxl355(uint8_t value, int k) {
    uint8_t address = command_ >> 1;
    if (!(command_ & 1)) {
      if (address == 0x2D && value == 0)
        start_ = host_us();
      return 0;
    }
    switch (address) {
      case 0x00: return 0xAD;
      case 0x05: return (uint8_t)(3 * (waiting(1000) < 32 ? waiting(1000) : 32));
      case 0x06: return k == 0 ? 0x07 : 0x5D;  // 1885: 25 degrees
      case 0x11: {
        int64_t number = (int64_t)next_, axes[3] = {number, -number, 3 * number};
        uint32_t bits = (uint32_t)(axes[k / 3] & 0xFFFFF) << 4 | (k / 3 == 0);
        next_ += k == 8;
        return (uint8_t)(bits >> (8 * (2 - k % 3)));
      }
      default: return 0;
    }
  }
  uint8_t iis3dwb(uint8_t value, int k) {
    uint8_t address = command_ & 0x7F;
    if (!(command_ & 0x80)) {
      if (address == 0x10 && value == 0xA0)
        start_ = host_us();
      return 0;
    }
    uint64_t n = waiting(26667.0) < 511 ? waiting(26667.0) : 511;
    switch (address) {
      case 0x0F: return 0x7B;
      case 0x3A: return (uint8_t)(n >> (8 * k));
      case 0x78: {
        double angle = 2 * M_PI * (double)next_ / 26667.0;
        double axes[3] = {1000 + 500 * sin(100 * angle), -1000, 500 * sin(900 * angle)};
        next_ += k == 6;
        return k == 0 ? 0x02 << 3 : (uint8_t)((int16_t)lrint(axes[(k - 1) / 2]) >> (k % 2 ? 0 : 8));
      }
      default: return 0;
    }
  }
  int at_ = -1;
  uint8_t command_ = 0;
  uint64_t start_ = 0, next_ = 0;
};
extern SPIClass SPI;
