/* Decodes CAN frames with the flight computer's tables and encodes them again, for flight_computer.py.
 *
 * Usage: messages fd|classic COUNTER < frames, a line each: IDENTIFIER BYTES, hexadecimal
 * Prints for each set that is complete its values, then its frames. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "messages.h"

int main(int argc, char **argv) {
    static struct message_decoder decoder;
    struct set_values set;
    unsigned id;
    char hex[129];
    if (argc != 3) return 2;
    while (scanf("%x %128s", &id, hex) == 2) {
        struct can_frame_bytes frame = {.id = (uint16_t)id, .length = (uint8_t)(strlen(hex) / 2)}, out[FRAMES_OF_SET_MAX];
        frame.fd = frame.length > 8;
        for (unsigned i = 0, byte; i < frame.length; ++i) {
            if (sscanf(hex + 2 * i, "%2x", &byte) != 1) return 2;
            frame.data[i] = (uint8_t)byte;
        }
        memset(&set, 0, sizeof set);
        if (!messages_accept(&decoder, &frame, &set)) continue;
        printf("set %d", (int)set.id);
        for (int i = 0; i < SIGNALS_MAX; ++i) printf(" %.17g", set.value[i]);
        const int n = messages_encode(&set, (uint8_t)atoi(argv[2]), strcmp(argv[1], "fd") == 0, out);
        for (int f = 0; f < n; ++f) {
            printf("\n%X ", (unsigned)out[f].id);
            for (int i = 0; i < out[f].length; ++i) printf("%02X", (unsigned)out[f].data[i]);
        }
        printf("\n");
    }
    return 0;
}
