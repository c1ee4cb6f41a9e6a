// An I2C bus with an ADXL355 on it: scan k, every 8 ms, is (k, -k, 3 k); 32 scans wait in its memory.
#pragma once
#include "Arduino.h"

class TwoWire {
 public:
  void begin() {}
  void setClock(uint32_t) {}
  void beginTransmission(uint8_t address) { here_ = address == 0x1D, n_ = 0; }
  void write(uint8_t value) {
    if (n_++ == 0)
      register_ = value;
    else if (register_ == 0x2D && value == 0)
      start_ = host_us();
    else if (register_ == 0x28)
      period_ = 250u << (value & 0x0F);  // 4000 Hz and below
  }
  uint8_t endTransmission(bool = true) { return here_ ? 0 : 2; }
  uint8_t requestFrom(uint8_t, uint8_t n) {
    advance();
    for (at_ = 0; at_ < n; at_++)
      content_[at_] = value(at_);
    at_ = 0;
    return n;
  }
  int read() { return content_[at_++]; }

 private:
  void advance() {
    uint64_t made = start_ ? (host_us() - start_) / period_ : 0;
    if (made > next_ + 32) {
      overrun_ = true;
      next_ = made - 32;
    }
    waiting_ = (uint8_t)(made - next_);
  }
  uint8_t value(uint8_t k) {
    uint8_t status = overrun_ ? 0x04 : 0;
    switch (register_) {
      case 0x00: return 0xAD;
      case 0x04: overrun_ = false; return status;
      case 0x05: return (uint8_t)(3 * waiting_);
      case 0x11: return entry(k);
      default: return 0;
    }
  }
  uint8_t entry(uint8_t k) {  // byte k of a scan
    int64_t number = (int64_t)next_, axes[3] = {number, -number, 3 * number};
    uint32_t bits = (uint32_t)(axes[k / 3] & 0xFFFFF) << 4 | (waiting_ ? 0 : 0x02) | (k / 3 == 0);
    next_ += waiting_ && k == 8;
    return (uint8_t)(bits >> (8 * (2 - k % 3)));
  }
  bool here_ = false, overrun_ = false;
  uint8_t register_ = 0, n_ = 0, at_ = 0, waiting_ = 0, content_[32] = {};
  uint32_t period_ = 250;
  uint64_t start_ = 0, next_ = 0;
};
extern TwoWire Wire;
