/* exit_status.h - as of narpa's own programs. */
#ifndef EXIT_STATUS_H
#define EXIT_STATUS_H

enum { EXIT_FAILED = 1, EXIT_BAD_INPUT = 2, EXIT_NO_DEVICE = 3 };

#endif
