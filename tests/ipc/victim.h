// A client that is going to be killed: it does one kind of thing, or anything, at random and as fast as it can.
#pragma once

#include <forceserver/forceserver.h>

namespace life {

// What it does. In the middle of what each is killed is left to chance, and there are many.
inline constexpr const char* victim_works[] = {
    "connects",    // and goes, and connects
    "moves",       // its objects, one by one: mostly it is writing one in the shared memory
    "batches",     // groups of 64 moves, which the server must take together
    "meshes",      // of 10,000 to 100,000 triangles, and curves: being made, sent, built, replaced
    "everything",  // all that a client can do, to its own objects and those of others
};

// All its objects together push with this much at most, N, along one direction; however it changes and moves them, it is
// the fade alone that changes the force.
inline constexpr double victim_force = 1;

// main, with the arguments "--victim ENDPOINT NAME WORK SEED". It tells "connected" when it is, and what no client may see.
int be_a_victim(int count, char** arguments);

}  // namespace life
