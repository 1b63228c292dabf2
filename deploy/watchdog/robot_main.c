/* A whole robot around the watchdog, on Linux: 200 Hz, UDP, but no thrusters and no sensors.
 * Put yours where it says YOURS.
 *
 *   gcc -O2 -Wall -Wextra -Werror -o robot robot_main.c watchdog.c blink.c health.c tool.c attitude.c hmac.c -lm
 *   ./robot KEY_FILE PORT THRUSTERS F_MAX_N MAX_RISE_PER_COMMAND_N RAMP_MS [E_STOP_FILE]
 *
 * KEY_FILE is what `lightleash robot key` has made; on a microcontroller the key is in flash.
 * E_STOP_FILE is the input of the emergency stop's wire, as /sys/class/gpio/gpio17/value: 1 is closed, anything
 * else is open, no file too; on a microcontroller a pin with a pull-down, the wire from its supply.
 */
#define _GNU_SOURCE
#include "blink.h"
#include "health.h"
#include "tool.h"
#include "watchdog.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define TICK_US 5000
#define FORGET_PEER_US 5000000
#define MAX_DATAGRAMS 64 /* taken before the clock is looked at again: a flood delays no tick */

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

static uint64_t random_u64(void)
{
    uint64_t value = 0;
    while (value == 0)
        if (getrandom(&value, sizeof value, 0) != sizeof value)
            value = 0;
    return value;
}

static unsigned hex_value(char digit)
{
    return (unsigned)(digit <= '9' ? digit - '0' : (digit | 32) - 'a' + 10);
}

/* 32 hexadecimal digits that nobody else may read; blanks around them, nothing else. */
static bool read_key(const char *path, uint8_t key[LL_KEY_BYTES])
{
    struct stat about;
    char text[1024], *digits = text;
    FILE *file = fopen(path, "r");
    bool good = file && fstat(fileno(file), &about) == 0 && (about.st_mode & 077) == 0;
    size_t size = good ? fread(text, 1, sizeof text, file) : 0;
    if (file)
        fclose(file);
    for (; size > 0 && isspace((unsigned char)digits[size - 1]); size--)
        ;
    for (; size > 0 && isspace((unsigned char)*digits); size--)
        digits++;
    good = size == 2 * LL_KEY_BYTES;
    for (size_t i = 0; good && i < size; i++) {
        good = isxdigit((unsigned char)digits[i]);
        key[i / 2] = (uint8_t)(key[i / 2] << 4 | hex_value(digits[i]));
    }
    return good;
}

static void give(const float *thrusts)
{
    (void)thrusts; /* YOURS: tell the motors */
}

static void shine(int dark)
{
    (void)dark; /* YOURS: all LEDs on but this one */
}

static void open_tool(int opening)
{
    (void)opening; /* YOURS: move it there; LL_TOOL_STAYS: stop it where it is */
}

static void sense(float gyro[3], float accelerometer[3])
{
    memset(gyro, 0, 3 * sizeof *gyro); /* YOURS: read the sensors, body axes, SI */
    accelerometer[0] = accelerometer[1] = 0.0f;
    accelerometer[2] = 9.80665f;
}

static float battery_v(void)
{
    return NAN; /* YOURS: measure it; NAN if you can't */
}

static bool is_open(const char *e_stop)
{
    char said = 0;
    int fd = open(e_stop, O_RDONLY);
    bool closed = fd >= 0 && read(fd, &said, 1) == 1 && said == '1';
    if (fd >= 0)
        close(fd);
    return !closed;
}

typedef struct {
    struct sockaddr_in address;
    int64_t heard_us;
} peer;

typedef struct {
    peer control, asking; /* gets all samples; gets the next one */
} recipients;

static bool same(const struct sockaddr_in *a, const struct sockaddr_in *b)
{
    return a->sin_addr.s_addr == b->sin_addr.s_addr && a->sin_port == b->sin_port;
}

/* Take some of what has arrived. */
static void receive(int fd, ll_watchdog *w, ll_blink *b, ll_tool *t, recipients *to)
{
    uint8_t data[LL_MAX_BYTES + 1];
    for (int i = 0; i < MAX_DATAGRAMS; i++) {
        struct sockaddr_in from;
        socklen_t length = sizeof from;
        ssize_t size = recvfrom(fd, data, sizeof data, MSG_DONTWAIT, (struct sockaddr *)&from,
                                &length);
        if (size < 0)
            return;
        bool answer;
        int64_t now_us = clock_us();
        if (ll_blink_receive(b, w, data, (size_t)size, now_us) ||
            ll_tool_receive(t, w, data, (size_t)size, now_us))
            continue;
        if (ll_receive(w, data, (size_t)size, now_us, &answer) == LL_NONE)
            to->control = (peer){from, now_us};
        if (answer)
            to->asking = (peer){from, now_us};
    }
}

static void send_to(int fd, const uint8_t *data, size_t size, const struct sockaddr_in *address)
{
    sendto(fd, data, size, MSG_DONTWAIT, (const struct sockaddr *)address, sizeof *address);
}

static void send_all(int fd, const uint8_t *data, size_t size, const recipients *to, int64_t now_us)
{
    bool lately = to->control.heard_us && now_us - to->control.heard_us <= FORGET_PEER_US;
    if (lately)
        send_to(fd, data, size, &to->control.address);
    if (to->asking.heard_us && !(lately && same(&to->asking.address, &to->control.address)))
        send_to(fd, data, size, &to->asking.address);
}

static void tick(int fd, ll_watchdog *w, const ll_blink *b, const ll_tool *t, ll_health *h, recipients *to,
                 const char *e_stop)
{
    float thrusts[LL_MAX_THRUSTERS], gyro[3], accelerometer[3];
    uint8_t out[LL_MAX_BYTES], told[LL_HEALTH_BYTES];
    int64_t now_us = clock_us();
    if (e_stop)
        ll_wire(w, is_open(e_stop));
    ll_setpoint(w, now_us, thrusts);
    give(thrusts);
    shine(ll_blink_dark(b, now_us));
    open_tool(ll_tool_wanted(t, w, now_us));
    sense(gyro, accelerometer);
    size_t size = ll_sample(w, now_us, random_u64(), gyro, accelerometer, thrusts, out);
    send_all(fd, out, size, to, now_us);
    size = ll_health_due(h, w, battery_v(), now_us, told);
    if (size > 0)
        send_all(fd, told, size, to, now_us);
    to->asking.heard_us = 0;
}

int main(int argc, char **argv)
{
    uint8_t key[LL_KEY_BYTES] = {0};
    if (argc < 7 || argc > 8 || atoi(argv[3]) < 1 || atoi(argv[3]) > LL_MAX_THRUSTERS) {
        fprintf(stderr, "usage: %s KEY_FILE PORT THRUSTERS(1-%d) F_MAX_N MAX_RISE_N RAMP_MS "
                "[E_STOP_FILE]\n",
                argv[0], LL_MAX_THRUSTERS);
        return 2;
    }
    if (!read_key(argv[1], key)) {
        fprintf(stderr, "%s: no key there, or others may read it: lightleash robot key\n", argv[1]);
        return 2;
    }
    /* YOURS if it flies: in place of NULL the numbers of hardware/attitude_keeper.py */
    ll_limits limits = {(uint8_t)atoi(argv[3]), atof(argv[4]), atof(argv[5]),
                        1000 * (int64_t)atoi(argv[6]), NULL};
    const char *e_stop = argc == 8 ? argv[7] : NULL;
    ll_watchdog w;
    ll_blink b;
    ll_tool t;
    ll_health h;
    ll_blink_init(&b);
    ll_tool_init(&t);
    ll_health_init(&h);
    if (!ll_init(&w, &limits, (uint32_t)random_u64(), key)) {
        fprintf(stderr, "F_MAX_N, MAX_RISE_N and RAMP_MS must be finite and above 0\n");
        return 2;
    }
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argv[2]))};
    own.sin_addr.s_addr = htonl(INADDR_ANY);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&own, sizeof own) != 0) {
        perror("bind");
        return 1;
    }
    signal(SIGTERM, stop);
    signal(SIGINT, stop);
    recipients to = {0};
    struct pollfd readable = {.fd = fd, .events = POLLIN};
    for (int64_t next_us = clock_us(); !stopping;) {
        int64_t wait_us = next_us - clock_us();
        if (wait_us > 0 && poll(&readable, 1, (int)((wait_us + 999) / 1000)) > 0)
            receive(fd, &w, &b, &t, &to);
        if (clock_us() >= next_us) { /* due by the clock, whatever arrives */
            tick(fd, &w, &b, &t, &h, &to, e_stop);
            next_us += TICK_US;
        }
    }
    ll_halt(&w);
    tick(fd, &w, &b, &t, &h, &to, e_stop);
    close(fd);
    return 0;
}
