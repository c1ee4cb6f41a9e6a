// Lines of text for the driver serial-text: an ADXL355 on I2C, 125 scans per second.
//
//     $counter,x,y,z*hh        x, y, z in counts of 3.9e-6 g; hh: exclusive or of the characters between $ and *
//
// Any board with the Arduino core: Uno, Nano, Mega, ESP32, Pico, Teensy. The scans wait in the memory of the sensor for
// up to 0.25 s. Scans that are lost all the same are counted.
//
//     text = {columns = ["counter", "x", "y", "z"], scale = 3.83072e-5}
#include <Wire.h>

const uint8_t SENSOR = 0x1D;  // 0x53 if ASEL is high
const uint32_t PERIOD_US = 8000;
const uint8_t ODR_125_HZ = 0x05;  // low-pass filter at 31.25 Hz; 0x04: 250 Hz, 0x03: 500 Hz (then baud 230400)

const uint8_t DEVICE_ID = 0x00, STATUS = 0x04, FIFO_ENTRIES = 0x05, FIFO_DATA = 0x11;
const uint8_t FILTER = 0x28, RANGE = 0x2C, POWER = 0x2D, RESET = 0x2F;
const uint8_t FIFO_OVERRUN = 0x04, IS_X = 0x01, IS_EMPTY = 0x02;

static void writeRegister(uint8_t address, uint8_t value) {
  Wire.beginTransmission(SENSOR);
  Wire.write(address);
  Wire.write(value);
  Wire.endTransmission();
}

static bool readRegisters(uint8_t address, uint8_t *content, uint8_t n) {
  Wire.beginTransmission(SENSOR);
  Wire.write(address);
  if (Wire.endTransmission(false) != 0 || Wire.requestFrom(SENSOR, n) != n)
    return false;
  for (uint8_t k = 0; k < n; k++)
    content[k] = (uint8_t)Wire.read();
  return true;
}

static int32_t axis(const uint8_t *entry) {  // 20 bits, the highest first
  uint32_t bits = (uint32_t)entry[0] << 24 | (uint32_t)entry[1] << 16 | (uint32_t)(entry[2] & 0xF0) << 8;
  return (int32_t)bits / 4096;
}

static void sendScan(uint32_t counter, const uint8_t *entries) {
  char line[56];
  int n = snprintf(line, sizeof line, "$%lu,%ld,%ld,%ld", (unsigned long)counter, (long)axis(entries),
                   (long)axis(entries + 3), (long)axis(entries + 6));
  uint8_t sum = 0;
  for (int k = 1; k < n; k++)
    sum ^= (uint8_t)line[k];
  snprintf(line + n, sizeof line - n, "*%02X", sum);
  Serial.println(line);
}

static void startSensor() {
  uint8_t found = 0;
  while (!readRegisters(DEVICE_ID, &found, 1) || found != 0xAD) {
    Serial.println("# no ADXL355 found");
    delay(1000);
  }
  writeRegister(RESET, 0x52);
  delay(10);
  writeRegister(RANGE, 0x81);  // 2 g
  writeRegister(FILTER, ODR_125_HZ);
  writeRegister(POWER, 0x00);  // measure
}

void setup() {
  Serial.begin(115200);
  Wire.begin();
  Wire.setClock(400000);
  startSensor();
}

void loop() {
  static uint32_t counter = 0, last = 0;
  uint8_t status = 0, entries = 0, scan[9];
  if (!readRegisters(STATUS, &status, 1) || !readRegisters(FIFO_ENTRIES, &entries, 1))
    return;
  uint32_t waiting = entries / 3, now = micros();
  if (status & FIFO_OVERRUN) {
    uint32_t passed = (now - last) / PERIOD_US;
    counter += passed > waiting ? passed - waiting : 1;
  }
  if (waiting == 0 || !readRegisters(FIFO_DATA, scan, 9) || scan[2] & IS_EMPTY || !(scan[2] & IS_X))
    return;
  last = now - (waiting - 1) * PERIOD_US;  // when it was taken; to send it may take long
  sendScan(counter++, scan);
}
