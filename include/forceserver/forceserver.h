/* forceserver.h - say what should be felt; a servo makes it felt, a thousand times a second and more.
 *
 * An application fills a scene with force-objects (primitive + profiles + pose). The scene is evaluated in this
 * process (fs_tool, fs_servo), or in a server that several applications share (fs_scene_connect): the same calls.
 * Method: Flueckiger & Nguyen, "A Generic Force-Server for Haptic Devices" (NASA Ames / EPFL; below: the paper).
 *
 * In reading order: base.h (statuses, plain data), object.h (what is felt), scene.h (the objects of an application),
 * evaluate.h (a loop of one's own), device.h, servo.h (the real-time loop), server.h (several processes). For those
 * who write a device driver: driver.h, which is not included here.
 *
 *     fs_scene *scene; fs_device *device; fs_servo *servo;           (each call returns an fs_status: look at it)
 *     fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
 *     spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
 *     fs_scene_create(&scene); fs_object_set(scene, &spring);
 *     fs_device_open("sim:", &device); fs_servo_start(scene, device, NULL, &servo);      now it is felt
 *
 * Units    SI: m, N, N m, s, rad, kg. Right-handed frames. Quaternions (w, x, y, z) turn object to parent; they are
 *          normalised when within 1e-3 of unit length; all zeros means the identity. Coordinates lie within 1e15 m.
 * Frames   object -pose-> scene -frame-> device. Device: origin at the centre of the workspace; for the user who
 *          faces it x is right, y forward (away), z up. Everything is in the scene frame unless its comment says other.
 * Time     seconds on the scene's clock (fs_scene_get_time); FS_NOW (0) means when the call is made.
 * Errors   an fs_status: 0 good, negative bad; then nothing was changed and no output written, unless stated.
 *          fs_last_error() is a sentence with the field, the value and the bound. Pointers are non-null and numbers
 *          finite unless a comment says other, else FS_ERROR_INVALID. Any call may return _INVALID, _MEMORY,
 *          _INTERNAL, and with a connected scene _DISCONNECTED; further ones are listed.
 * Handles  reference-counted inside: a handle keeps alive what it was made from, so the order of destruction is free.
 *          _destroy, _close, _stop, _release give back the caller's reference and accept null; no other call may be
 *          under way with it then, or come afterwards.
 * Waiting  a call waits for nobody, unless its comment gives a time. Connected: a change is sent without waiting for an
 *          answer. When the queue to the server is full, or when a call needs an answer from it, the call waits 1 s
 *          at most, and 1 s more for each mesh or curve that it has to fetch: then TIMEOUT. Nothing has changed then, but
 *          a question that was sent (about another client's object) may still be acted on. These limits also hold when
 *          signals arrive or the server is stopped; while one thread waits, calls of other threads go on.
 * Input    is copied (handles: referenced) before the call returns.
 * Lists    (out, capacity, count): at most capacity are written (capacity 0: out may be null), *count is how many
 *          there are. A small buffer is not an error.
 * Threads  any call from any thread; calls on one handle are serialised. [rt]: no lock, allocation or system call,
 *          never waits for calls on the same handle from other threads.
 * ABI      frozen structs never change and their `reserved` is 0. Growing structs begin with struct_size, are made by
 *          their inline _init and grow at the end only; no struct has padding. Enum values never change. A struct_size
 *          larger than the library's: FS_ERROR_VERSION; smaller than that of the first version: FS_ERROR_INVALID.
 * "0.1:"   begins what this version does otherwise, or not yet; "0.1: UNSUPPORTED": the call returns that status. It is
 *          declared already, so that programs can be written for it.
 */
#ifndef FORCESERVER_FORCESERVER_H
#define FORCESERVER_FORCESERVER_H

#include <forceserver/base.h>
#include <forceserver/object.h>
#include <forceserver/scene.h>
#include <forceserver/evaluate.h>
#include <forceserver/device.h>
#include <forceserver/servo.h>
#include <forceserver/server.h>

#endif
