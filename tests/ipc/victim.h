// A client that is going to be killed: it makes one kind of call, or any calls, at random and as fast as it can.
#pragma once

#include <forceserver/forceserver.h>

namespace life {

// What it does. The moment at which each is killed is chance, and there are many of them.
inline constexpr const char* victim_works[] = {
    "connects",    // and goes, and connects
    "moves",       // its objects, one by one: mostly it is writing one in the shared memory
    "batches",     // groups of 64 moves, which the server must take together
    "meshes",      // of 10,000 to 100,000 triangles, and curves: being made, sent, built, replaced
    "everything",  // all that a client can do, to its own objects and those of others
};

// All its objects together push with this much at most, N, along one direction; however it changes and moves them, it
// is the fade alone that changes the force.
inline constexpr double victim_force = 1;

// main, with the arguments "--victim ENDPOINT NAME WORK SEED". It tells "connected" when it is, and what no client may
// see.
int be_a_victim(int count, char** arguments);

// Of two that stop themselves at an exact place.
//
// "--writes ENDPOINT NAME N": its three objects push up with flip_force each. Told "go", it turns one of them over,
// then all in a group, and stops before the Nth time that it writes into the memory it shares with the server. It tells
// "over" when there were not as many, "unsupported" where it cannot do so.
inline constexpr double flip_force = 0.5;  // N
int be_a_writer(int count, char** arguments);

// "--calls ENDPOINT NAME": lets itself be traced, then connects, sends a mesh and a curve, asks this and that, and
// goes.
int be_a_caller(int count, char** arguments);

}  // namespace life
