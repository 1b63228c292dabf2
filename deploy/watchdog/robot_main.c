/* A whole robot around the watchdog, on Linux: 200 Hz, UDP, but no thrusters and no sensors.
 * Put yours where it says YOURS.
 *
 *   gcc -O2 -Wall -Wextra -Werror -o robot robot_main.c watchdog.c
 *   ./robot PORT THRUSTERS F_MAX_N MAX_RISE_PER_COMMAND_N RAMP_MS
 */
#define _GNU_SOURCE
#include "watchdog.h"

#include <arpa/inet.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define TICK_US 5000
#define FORGET_PEER_US 5000000

static volatile sig_atomic_t stopping;

static void stop(int number)
{
    (void)number;
    stopping = 1;
}

static int64_t clock_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static uint32_t random_u32(void)
{
    uint32_t value = 0;
    while (value == 0)
        if (getrandom(&value, sizeof value, 0) != sizeof value)
            value = 0;
    return value;
}

static void give(const float *thrusts)
{
    (void)thrusts; /* YOURS: tell the motors */
}

static void sense(float gyro[3], float accelerometer[3])
{
    memset(gyro, 0, 3 * sizeof *gyro); /* YOURS: read the sensors, body axes, SI */
    accelerometer[0] = accelerometer[1] = 0.0f;
    accelerometer[2] = 9.80665f;
}

typedef struct {
    struct sockaddr_in address;
    int64_t heard_us;
} peer;

/* Take what has arrived; whoever is heard gets samples, another one only after a silence. */
static void receive(int fd, ll_watchdog *w, peer *to)
{
    uint8_t data[LL_MAX_BYTES + 1];
    struct sockaddr_in from;
    socklen_t length = sizeof from;
    ssize_t size;
    while ((size = recvfrom(fd, data, sizeof data, MSG_DONTWAIT, (struct sockaddr *)&from,
                            &length)) >= 0) {
        int64_t now_us = clock_us();
        if (ll_receive(w, data, (size_t)size, now_us) == LL_MALFORMED)
            continue;
        bool same = from.sin_addr.s_addr == to->address.sin_addr.s_addr &&
                    from.sin_port == to->address.sin_port;
        if (same || now_us - to->heard_us > LL_SILENCE_US)
            *to = (peer){from, now_us};
        length = sizeof from;
    }
}

static void tick(int fd, ll_watchdog *w, const peer *to)
{
    float thrusts[LL_MAX_THRUSTERS], gyro[3], accelerometer[3];
    uint8_t out[LL_MAX_BYTES];
    int64_t now_us = clock_us();
    ll_setpoint(w, now_us, thrusts);
    give(thrusts);
    sense(gyro, accelerometer);
    size_t size = ll_sample(w, now_us, random_u32(), gyro, accelerometer, thrusts, out);
    if (now_us - to->heard_us <= FORGET_PEER_US)
        sendto(fd, out, size, MSG_DONTWAIT, (const struct sockaddr *)&to->address,
               sizeof to->address);
}

int main(int argc, char **argv)
{
    if (argc != 6 || atoi(argv[2]) < 1 || atoi(argv[2]) > LL_MAX_THRUSTERS) {
        fprintf(stderr, "usage: %s PORT THRUSTERS(1-%d) F_MAX_N MAX_RISE_N RAMP_MS\n", argv[0],
                LL_MAX_THRUSTERS);
        return 2;
    }
    ll_limits limits = {(uint8_t)atoi(argv[2]), atof(argv[3]), atof(argv[4]),
                        1000 * (int64_t)atoi(argv[5])};
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argv[1]))};
    own.sin_addr.s_addr = htonl(INADDR_ANY);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&own, sizeof own) != 0) {
        perror("bind");
        return 1;
    }
    signal(SIGTERM, stop);
    signal(SIGINT, stop);
    ll_watchdog w;
    ll_init(&w, &limits, random_u32());
    peer to = {.heard_us = -FORGET_PEER_US - 1};
    struct pollfd readable = {.fd = fd, .events = POLLIN};
    for (int64_t next_us = clock_us(); !stopping;) {
        int64_t wait_us = next_us - clock_us();
        if (wait_us > 0 && poll(&readable, 1, (int)((wait_us + 999) / 1000)) > 0)
            receive(fd, &w, &to);
        if (clock_us() >= next_us) {
            tick(fd, &w, &to);
            next_us += TICK_US;
        }
    }
    ll_halt(&w);
    tick(fd, &w, &to);
    close(fd);
    return 0;
}
