// The part of the Arduino core that the programs of examples/ use, on a computer: the serial port is the terminal.
#pragma once
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { LOW, HIGH, OUTPUT };

// Time of the board. With NEVER_HELD_UP it stands still while a busy computer does not run this program.
inline uint64_t host_us() {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  uint64_t now = (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
#ifdef NEVER_HELD_UP
  static uint64_t last = 0, held = 0;
  if (last && now - last > 5000)
    held += now - last - 5000;
  last = now;
  return now - held;
#else
  return now;
#endif
}

inline uint32_t micros() { return (uint32_t)host_us(); }
inline void delay(uint32_t ms) { usleep(1000 * ms); }
inline void pinMode(uint8_t, uint8_t) {}
void digitalWrite(uint8_t pin, uint8_t level);

struct SerialPort {
  void begin(unsigned long) {}
  int available() {
    struct pollfd input = {0, POLLIN, 0};
    return poll(&input, 1, 0) > 0;
  }
  int read() {
    uint8_t byte;
    if (::read(0, &byte, 1) != 1)
      _exit(0);  // the host has gone
    return byte;
  }
  int availableForWrite() { return 256; }
  void write(const void *content, size_t n) {
    if (::write(1, content, n) < 0)
      _exit(0);
  }
  void println(const char *text) {
    write(text, strlen(text));
    write("\r\n", 2);
  }
};
extern SerialPort Serial;
