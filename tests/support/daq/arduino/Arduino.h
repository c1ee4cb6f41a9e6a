// The part of the Arduino core that the sketches of examples/arduino use, on a computer.
#pragma once
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

inline uint64_t host_us() {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
}

inline uint32_t micros() { return (uint32_t)host_us(); }
inline void delay(uint32_t ms) { usleep(1000 * ms); }

struct SerialPort {
  void begin(unsigned long) {}
  void println(const char *text) {
    if (write(1, text, strlen(text)) < 0 || write(1, "\r\n", 2) < 0)
      _exit(0);  // the host has gone
  }
};
extern SerialPort Serial;
