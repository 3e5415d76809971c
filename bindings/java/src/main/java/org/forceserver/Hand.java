package org.forceserver;

/**
 * Where the hand is and what it feels.
 *
 * @param state the hand at the last tick, in the scene frame
 * @param response what this scene alone gives
 * @param sent what the device got of all scenes, after the guard, along this scene's axes
 */
public record Hand(State state, Response response, Wrench sent) {}
