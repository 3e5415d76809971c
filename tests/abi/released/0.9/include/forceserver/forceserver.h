/* forceserver.h - describe what should be felt; a servo renders it at 1 kHz and more.
 *
 * An application fills a scene with force-objects (primitive + profiles + pose). The scene is evaluated in this
 * process (fs_tool, fs_servo), or in a server that several applications share (fs_scene_connect), by the same calls.
 * Method: Flueckiger & Nguyen, "A Generic Force-Server for Haptic Devices" (NASA Ames / EPFL; below: the paper).
 *
 * In reading order: base.h (statuses, plain data), object.h (what is felt), scene.h (the objects of an application),
 * evaluate.h (your own loop), device.h, servo.h (the real-time loop), server.h (several processes). driver.h is for
 * authors of device drivers and is not included here.
 *
 *     fs_scene *scene; fs_device *device; fs_servo *servo;           (each call returns an fs_status: check it)
 *     fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
 *     spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
 *     fs_scene_create(&scene); fs_object_set(scene, &spring);
 *     fs_device_open("sim:", &device); fs_servo_start(scene, device, NULL, &servo);      now it is felt
 *
 * Units    SI: m, N, N m, s, rad, kg. Right-handed frames. Quaternions (w, x, y, z) rotate from object to parent;
 *          they are normalised when within 1e-3 of unit length; all zeros means the identity. Coordinates lie within
 *          1e15 m.
 * Frames   object -pose-> scene -frame-> device. The device's origin is the centre of its workspace; for the user who
 *          faces it x is right, y forward (away), z up. Everything is in the scene frame unless its comment says
 *          otherwise.
 * Time     seconds on the scene's clock (fs_scene_get_time); FS_NOW (0) means when the call is made.
 * Errors   a call returns an fs_status: 0 is success, negative is failure. A call that fails changes nothing and writes
 *          no output, unless its comment says otherwise. fs_last_error() then has a sentence with the field, the value
 *          and the bound. Pointers must be non-null and numbers finite unless a comment says otherwise, or the call
 *          fails with FS_ERROR_INVALID. Any call may return _INVALID, _MEMORY, _INTERNAL, and with a connected scene
 *          _DISCONNECTED; its comment lists the others, without FS_ERROR_.
 * Handles  are reference-counted inside: a handle keeps alive what it was made from, so they may be destroyed in any
 *          order. _destroy, _close, _stop, _release give back the caller's reference and accept null; no other call
 *          with that handle may be under way at that moment, or come afterwards.
 * Waiting  a call does not wait, unless its comment gives a time. Connected: a change is sent without waiting for an
 *          answer. When the queue to the server is full, or when a call needs an answer from it, the call waits 1 s
 *          at most, and 1 s more for each mesh or curve that it has to fetch; after that it returns TIMEOUT. Nothing
 *          has changed then, but the server may still act on a request that was sent (about another client's object).
 *          These limits also hold when signals arrive or the server is stopped; while one thread waits, other threads'
 *          calls go on.
 * Input    is copied (handles: referenced) before the call returns.
 * Lists    (out, capacity, count): at most capacity entries are written (with capacity 0 out may be null), and *count
 *          becomes the number of entries there are. A small buffer is not an error.
 * Threads  any thread may make any call; calls on one handle are serialised. A call marked [rt] takes no lock,
 *          allocates nothing, makes no system call and never waits for calls on the same handle from other threads.
 * ABI      frozen structs never change and their `reserved` is 0. Growing structs begin with struct_size, are made by
 *          their inline _init and grow at the end only; no struct has padding. Enum values never change. A program, a
 *          library and a server of different versions work together: each struct counts as far as both ends know it.
 *          Fields that the caller does not know count as 0, their default; fs_object_change leaves them as they are.
 *          Fields that the library or the server does not know must be 0, or it is FS_ERROR_VERSION; in a struct that the
 *          library fills they become 0. A struct_size below that of the first version, or no multiple of
 *          8: FS_ERROR_INVALID; above 4096: FS_ERROR_VERSION.
 * "0.9:"   precedes what this version does differently or not yet; "0.9: UNSUPPORTED": the call returns that status.
 *          The declaration is there already, so that programs can be written for it.
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
