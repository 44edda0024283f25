#include "messages.h"

#include <math.h>
#include <string.h>

#include "checksums.h"

enum { CLASSIC_BYTES = 8, FD_BYTES = 64, FD_OFFSET = 15, COUNTER_BIT = 48, CLASSIC_CRC = 7, FD_CRC = 62 };
#define QUATERNION_STEP (1.0 / 4194304)

struct signal {
    const char *name;
    uint8_t frame, bit, bits; /* classic frame and first bit of it; length */
    bool is_signed;
    double step;
    uint16_t fd_bit; /* first bit of the CAN FD frame */
};
struct set_row {
    const char *name;
    uint16_t base;
    uint8_t frames;
    uint16_t fd_counter_bit; /* 0: no CAN FD form */
    const struct signal *signals;
    uint8_t n;
};

static const struct signal heartbeat_signals[] = {
    [HEARTBEAT_TIME] = {"Time", 0, 0, 40, false, 1, 0},
    [HEARTBEAT_STATE] = {"State", 0, 40, 4, false, 1, 0},
};
static const struct signal ledger_signals[] = {
    [LEDGER_FRAME] = {"Frame", 0, 0, 32, false, 1, 0},
    [LEDGER_EXPOSURE_MID] = {"ExposureMid", 1, 0, 48, false, 1, 48},
    [LEDGER_DELIVERY] = {"Delivery", 9, 42, 2, false, 1, 344},
};
static const struct signal attitude_signals[] = {
    [ATTITUDE_TIME] = {"Time", 0, 0, 48, false, 1, 0},
    [ATTITUDE_ATTITUDE_W] = {"AttitudeW", 1, 0, 24, true, QUATERNION_STEP, 48},
    [ATTITUDE_ATTITUDE_X] = {"AttitudeX", 1, 24, 24, true, QUATERNION_STEP, 72},
    [ATTITUDE_ATTITUDE_Y] = {"AttitudeY", 2, 0, 24, true, QUATERNION_STEP, 96},
    [ATTITUDE_ATTITUDE_Z] = {"AttitudeZ", 2, 24, 24, true, QUATERNION_STEP, 120},
    [ATTITUDE_RATE_X] = {"RateX", 3, 0, 24, true, 1e-06, 144},
    [ATTITUDE_RATE_Y] = {"RateY", 3, 24, 24, true, 1e-06, 168},
    [ATTITUDE_RATE_Z] = {"RateZ", 4, 0, 24, true, 1e-06, 192},
};
static const struct signal dynamics_signals[] = {
    [DYNAMICS_TIME] = {"Time", 0, 0, 48, false, 1, 0},
    [DYNAMICS_START] = {"Start", 1, 0, 48, false, 1, 48},
    [DYNAMICS_PHASE] = {"Phase", 2, 0, 4, false, 1, 96},
};
static const struct signal actuator_signals[] = {
    [ACTUATOR_TIME] = {"Time", 0, 0, 48, false, 1, 0},
    [ACTUATOR_IMPULSE_X] = {"ImpulseX", 1, 0, 24, true, 0.001, 48},
    [ACTUATOR_IMPULSE_Y] = {"ImpulseY", 1, 24, 24, true, 0.001, 72},
    [ACTUATOR_IMPULSE_Z] = {"ImpulseZ", 2, 0, 24, true, 0.001, 96},
    [ACTUATOR_ANGULAR_IMPULSE_X] = {"AngularImpulseX", 2, 24, 24, true, 0.001, 120},
    [ACTUATOR_ANGULAR_IMPULSE_Y] = {"AngularImpulseY", 3, 0, 24, true, 0.001, 144},
    [ACTUATOR_ANGULAR_IMPULSE_Z] = {"AngularImpulseZ", 3, 24, 24, true, 0.001, 168},
    [ACTUATOR_LEG] = {"Leg", 4, 0, 8, false, 1, 192},
    [ACTUATOR_PHASE] = {"Phase", 4, 8, 4, false, 1, 200},
    [ACTUATOR_ABORT] = {"Abort", 4, 12, 4, false, 1, 204},
};
static const struct signal navigation_signals[] = {
    [NAVIGATION_TIME] = {"Time", 0, 0, 48, false, 1, 0},
    [NAVIGATION_POSITION_X] = {"PositionX", 1, 0, 48, true, 1e-06, 48},
    [NAVIGATION_POSITION_Y] = {"PositionY", 2, 0, 48, true, 1e-06, 96},
    [NAVIGATION_POSITION_Z] = {"PositionZ", 3, 0, 48, true, 1e-06, 144},
    [NAVIGATION_ATTITUDE_W] = {"AttitudeW", 4, 0, 24, true, QUATERNION_STEP, 192},
    [NAVIGATION_ATTITUDE_X] = {"AttitudeX", 4, 24, 24, true, QUATERNION_STEP, 216},
    [NAVIGATION_ATTITUDE_Y] = {"AttitudeY", 5, 0, 24, true, QUATERNION_STEP, 240},
    [NAVIGATION_ATTITUDE_Z] = {"AttitudeZ", 5, 24, 24, true, QUATERNION_STEP, 264},
    [NAVIGATION_SIGMA_X] = {"SigmaX", 6, 0, 24, false, 1e-06, 288},
    [NAVIGATION_SIGMA_Y] = {"SigmaY", 6, 24, 24, false, 1e-06, 312},
    [NAVIGATION_SIGMA_Z] = {"SigmaZ", 7, 0, 24, false, 1e-06, 336},
    [NAVIGATION_SIGMA_ROT_X] = {"SigmaRotX", 7, 24, 24, false, 1e-07, 360},
    [NAVIGATION_SIGMA_ROT_Y] = {"SigmaRotY", 8, 0, 24, false, 1e-07, 384},
    [NAVIGATION_SIGMA_ROT_Z] = {"SigmaRotZ", 8, 24, 24, false, 1e-07, 408},
    [NAVIGATION_CYCLE] = {"Cycle", 9, 0, 32, false, 1, 432},
    [NAVIGATION_FRAMES] = {"Frames", 9, 32, 8, false, 1, 464},
    [NAVIGATION_SWEEPS] = {"Sweeps", 9, 40, 8, false, 1, 472},
};
static const struct signal housekeeping_signals[] = {
    [HOUSEKEEPING_MODE] = {"Mode", 0, 0, 8, false, 1, 0},
    [HOUSEKEEPING_LAMPS] = {"Lamps", 0, 8, 8, false, 1, 0},
    [HOUSEKEEPING_FRAMES] = {"Frames", 0, 16, 16, false, 1, 0},
    [HOUSEKEEPING_LOST] = {"DatagramsLost", 0, 32, 16, false, 1, 0},
};

static const struct set_row sets[SETS] = {
    [SET_HEARTBEAT] = {"Heartbeat", 0x701, 1, 0, heartbeat_signals, HEARTBEAT_SIGNALS},
    [SET_LEDGER] = {"Ledger", 0x600, 10, 472, ledger_signals, LEDGER_SIGNALS},
    [SET_ATTITUDE] = {"Attitude", 0x740, 5, 216, attitude_signals, ATTITUDE_SIGNALS},
    [SET_DYNAMICS] = {"Dynamics", 0x750, 3, 104, dynamics_signals, DYNAMICS_SIGNALS},
    [SET_ACTUATOR] = {"Actuator", 0x720, 5, 208, actuator_signals, ACTUATOR_SIGNALS},
    [SET_NAVIGATION] = {"Navigation", 0x730, 10, 480, navigation_signals, NAVIGATION_SIGNALS},
    [SET_HOUSEKEEPING] = {"Housekeeping", 0x7C0, 1, 0, housekeeping_signals, HOUSEKEEPING_SIGNALS},
};

static uint64_t bits_at(const uint8_t *bytes, unsigned bit, unsigned n) {
    uint64_t value = 0;
    for (unsigned i = 0; i < n; ++i) value |= (uint64_t)(bytes[(bit + i) / 8] >> (bit + i) % 8 & 1) << i;
    return value;
}
static void put_bits(uint8_t *bytes, unsigned bit, unsigned n, uint64_t value) {
    for (unsigned i = 0; i < n; ++i) bytes[(bit + i) / 8] |= (uint8_t)((value >> i & 1) << (bit + i) % 8);
}

/* Writes the checksum at the end of the frame, over its identifier and all bytes before; false: there was another. */
static bool seal(struct can_frame_bytes *frame) {
    const uint8_t id[2] = {(uint8_t)frame->id, (uint8_t)(frame->id >> 8)};
    if (!frame->fd) {
        const uint8_t crc = crc8(frame->data, CLASSIC_CRC, crc8(id, 2, CRC8_START)) ^ CRC8_END;
        const bool same = frame->data[CLASSIC_CRC] == crc;
        frame->data[CLASSIC_CRC] = crc;
        return same;
    }
    const uint16_t crc = crc16(frame->data, FD_CRC, crc16(id, 2, CRC16_START));
    const bool same = frame->data[FD_CRC] == (crc & 0xFF) && frame->data[FD_CRC + 1] == crc >> 8;
    frame->data[FD_CRC] = (uint8_t)crc, frame->data[FD_CRC + 1] = (uint8_t)(crc >> 8);
    return same;
}

/* The most negative value of a signed signal means "not available". */
static bool is_available(const struct signal *s, int64_t raw) {
    return !s->is_signed || raw != -((int64_t)1 << (s->bits - 1));
}

static int64_t read_signal(const struct signal *s, const uint8_t *data, unsigned bit) {
    uint64_t raw = bits_at(data, bit, s->bits);
    if (s->is_signed && raw >> (s->bits - 1) != 0) raw |= ~(uint64_t)0 << s->bits;
    return (int64_t)raw;
}

static bool complete(const struct set_row *row, enum set_id id, const int64_t raw[], struct set_values *out) {
    out->id = id;
    for (int i = 0; i < row->n; ++i) {
        if (!is_available(&row->signals[i], raw[i])) return false;
        out->value[i] = (double)raw[i] * row->signals[i].step;
    }
    return true;
}

bool messages_accept(struct message_decoder *decoder, const struct can_frame_bytes *frame, struct set_values *out) {
    for (int id = 0; id < SETS; ++id) {
        const struct set_row *row = &sets[id];
        const unsigned base = row->base + (id == SET_LEDGER ? 16u * decoder->ledger_camera : 0u);
        const unsigned offset = frame->id - base;
        if (frame->id < base || (offset >= row->frames && (offset != FD_OFFSET || row->fd_counter_bit == 0))) continue;
        const bool fd = offset == FD_OFFSET;
        struct can_frame_bytes copy = *frame;
        if (frame->fd != fd || frame->length != (fd ? FD_BYTES : CLASSIC_BYTES) || !seal(&copy)) {
            ++decoder->bad;
            return false;
        }
        if (fd) {
            int64_t raw[SIGNALS_MAX];
            for (int i = 0; i < row->n; ++i)
                raw[i] = read_signal(&row->signals[i], frame->data, row->signals[i].fd_bit);
            return complete(row, (enum set_id)id, raw, out);
        }
        const uint8_t counter = (uint8_t)bits_at(frame->data, COUNTER_BIT, 8);
        if (decoder->set[id].counter != counter || decoder->set[id].frames == 0) {
            decoder->incomplete += decoder->set[id].frames != 0;
            decoder->set[id].counter = counter, decoder->set[id].frames = 0;
        }
        decoder->set[id].frames |= 1u << offset;
        for (int i = 0; i < row->n; ++i)
            if (row->signals[i].frame == offset)
                decoder->set[id].raw[i] = read_signal(&row->signals[i], frame->data, row->signals[i].bit);
        if (decoder->set[id].frames != (1u << row->frames) - 1) return false;
        decoder->set[id].frames = 0;
        return complete(row, (enum set_id)id, decoder->set[id].raw, out);
    }
    return false;
}

static uint64_t raw_of(const struct signal *s, double value) {
    const double most = ldexp(1, s->bits - (s->is_signed ? 1 : 0)) - 1, least = s->is_signed ? -most : 0;
    if (!isfinite(value)) return s->is_signed ? (uint64_t)1 << (s->bits - 1) : (uint64_t)most;
    return (uint64_t)(int64_t)fmin(fmax(round(value / s->step), least), most);
}

int messages_encode(const struct set_values *in, uint8_t counter, bool fd,
                    struct can_frame_bytes out[FRAMES_OF_SET_MAX]) {
    const struct set_row *row = &sets[in->id];
    fd = fd && row->fd_counter_bit != 0;
    const int frames = fd ? 1 : row->frames;
    for (int f = 0; f < frames; ++f) {
        struct can_frame_bytes *frame = &out[f];
        memset(frame, 0, sizeof *frame);
        frame->id = (uint16_t)(row->base + (fd ? FD_OFFSET : f));
        frame->fd = fd, frame->length = fd ? FD_BYTES : CLASSIC_BYTES;
        for (int i = 0; i < row->n; ++i) {
            const struct signal *s = &row->signals[i];
            if (fd || s->frame == f) put_bits(frame->data, fd ? s->fd_bit : s->bit, s->bits, raw_of(s, in->value[i]));
        }
        put_bits(frame->data, fd ? row->fd_counter_bit : COUNTER_BIT, 8, counter);
        seal(frame);
    }
    return frames;
}

void messages_print(FILE *out) {
    for (int id = 0; id < SETS; ++id) {
        const struct set_row *row = &sets[id];
        for (int i = 0; i < row->n; ++i) {
            const struct signal *s = &row->signals[i];
            fprintf(out, "%s 0x%03X frames %u fd_counter %u: %s frame %u bit %u fd_bit %u bits %u %s step %.17g\n",
                    row->name, row->base, row->frames, row->fd_counter_bit, s->name, s->frame, s->bit, s->fd_bit,
                    s->bits, s->is_signed ? "signed" : "unsigned", s->step);
        }
    }
}
