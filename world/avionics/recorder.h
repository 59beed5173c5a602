/* SPDX-License-Identifier: Apache-2.0 */
#ifndef WORLD_AVIONICS_RECORDER_H
#define WORLD_AVIONICS_RECORDER_H

#include "flight/msg/avionics.h"
#include "world/msg/power.h"

#define RECORDER_PAGES 1024
#define RECORDER_WORDS 32 ///< of a page, each of 8 bytes
#define RECORDER_FAULTS 4

/** What may be wrong with the memory. */
typedef enum RecorderFaultKind {
    RECORDER_SOUND = 0,
    RECORDER_FLIP = 1, ///< bits change once
    RECORDER_WEAR = 2  ///< the page refuses to be written from now on
} RecorderFaultKind;

/** A fault that a mission plans. */
typedef struct RecorderFault {
    RecorderFaultKind kind;
    uint32_t page; ///< [-] in [0, 1023]: whose memory it is
    uint32_t bit;  ///< [-] in [0, 2047]: the first that flips; bit b is of byte b / 8
    uint32_t bits; ///< [-] in [0, 64]: how many flip, in a row
    int64_t begin; ///< [ns] >= 0: when it happens
} RecorderFault;

/** A solid-state recorder: writes and reads pages of 256 bytes, one request after another; the next one waits until it
 *  is ready. Its memory outlives resets of the computer and times without power; a run begins with it empty. Each word
 *  of 64 bits has 8 bits of a code that corrects one wrong bit, when the page is read, and finds two. Bits flip at
 *  random times, of data and code alike. A page that was written as often as `endurance` says is worn.
 *  Without power it does not answer. A page that is being written when power fails has its first words only, as many as
 *  the time was enough for. Switched on again, it knows no request, and serves the one that stands.
 *  Source: thesis section 5.4.2; Hsiao, A class of optimal minimum odd-weight-column SEC-DED codes, 1970. */
typedef struct Recorder {
    struct {
        RecorderRequest request; ///< optional: without it the memory stays as it is
        LoadSupply power;        ///< optional: without it the recorder is on
    } in;
    struct {
        RecorderReply reply;
        RecorderState state;
    } out;
    struct {
        uint32_t pages;     ///< [-] required, in [1, 1024]: of the memory
        uint32_t load;      ///< [-] in [0, 31]: the recorder's load in the power unit
        int64_t write_time; ///< [ns] >= 0: to write a page
        int64_t read_time;  ///< [ns] >= 0: to read a page
        double upsets;      ///< [1/s] >= 0, <= 1e6: how many bits of the memory flip in a second, on average
        uint32_t endurance; ///< [-] how often a page can be written; 0: for ever
        uint32_t n_faults;  ///< [-] in [0, 4]: number of planned faults
        RecorderFault faults[RECORDER_FAULTS]; ///< count n_faults: planned
    } par;
    struct {
        uint8_t memory[RECORDER_PAGES][RECORDER_PAGE]; ///< [-] the content of the pages
        uint8_t code[RECORDER_PAGES][RECORDER_WORDS];  ///< [-] of each word
        uint32_t writes[RECORDER_PAGES];               ///< [-] how often each page was written
        uint8_t data[RECORDER_PAGE];                   ///< [-] of the request that is being served
        int64_t begun;                                 ///< [ns] when it was begun
        uint32_t serving;                              ///< [-] RecorderCode of it; 0: none
        uint32_t number;                               ///< [-] of it
        uint32_t page;                                 ///< [-] of it
        uint32_t used;                                 ///< [-] pages up to the last one that was ever written
    } mem;
} Recorder;

#endif
