package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.function.Executable;

/** Buffers that cannot be taken are named, and nothing is written. */
class BuffersTest {
  private final DoubleBuffer six = Buffers.doubles(6);

  private void wrong(String sentence, DoubleBuffer positions, DoubleBuffer forces) {
    try (Scene scene = new Scene()) {
      scene.set(Support.spring("a"));
      IllegalArgumentException e = assertThrows(IllegalArgumentException.class, () -> scene.evaluate(positions, forces));
      assertTrue(e.getMessage().contains(sentence), e.getMessage());
    }
  }

  @Test void wrong_buffers() {
    DoubleBuffer foreign = ByteBuffer.allocateDirect(48).order(ByteOrder.BIG_ENDIAN).asDoubleBuffer();
    wrong("positions is not a direct buffer", DoubleBuffer.allocate(6), six);
    wrong("forces is not a direct buffer", six, DoubleBuffer.allocate(6));
    wrong("forces is not a direct buffer", six, DoubleBuffer.wrap(new double[6]));
    wrong("for reading only", six, six.asReadOnlyBuffer());
    wrong("positions has the order of bytes of another machine", foreign, six);
    wrong("forces has the order of bytes of another machine", six, foreign);
    wrong("forces holds 3 numbers; 2 positions need 6", six, Buffers.doubles(3));
    wrong("positions holds 5 numbers, must be a multiple of 3", Buffers.doubles(5), six);
    try (Scene scene = new Scene()) {
      assertThrows(NullPointerException.class, () -> scene.evaluate(null, six));
    }
  }

  @Test void positions_may_be_for_reading_only_and_part_of_a_buffer() {
    try (Scene scene = new Scene()) {
      scene.set(Support.spring("a"));
      DoubleBuffer positions = Buffers.of(9.0, 0.01, 0, 0, 0, 0.02, 0, 9);
      DoubleBuffer forces = Buffers.doubles(10);
      scene.evaluate(positions.position(1).limit(7).asReadOnlyBuffer(), forces.position(2).limit(8));
      assertEquals(-2, forces.get(2), 1e-12);
      assertEquals(-4, forces.get(6), 1e-12);
      assertEquals(0, forces.clear().get(8));
      assertEquals(0, forces.get(0));
      scene.evaluate(Buffers.doubles(0), Buffers.doubles(0));
    }
  }

  @Test void results_do_not_overlap_what_is_read() {
    DoubleBuffer room = Buffers.of(9.0, 0.01, 0, 0, 0, 0.02, 0, 9, 9);
    wrong("positions and forces overlap", room.slice(1, 6), room.slice(2, 6));
    try (Scene scene = new Scene()) {
      scene.set(Support.spring("a"));
      DoubleBuffer same = room.slice(1, 6);
      scene.evaluate(same, room.slice(1, 6));
      assertEquals(-2, same.get(0), 1e-12);
      assertEquals(-4, same.get(4), 1e-12);
    }
    Profile profile = Support.spring("a").front();
    assertThrows(IllegalArgumentException.class, () -> ForceServer.evaluate(profile, 0, six.slice(0, 3), six.slice(1, 3)));
  }

  @Test void the_glue_looks_too() {
    DoubleBuffer heap = DoubleBuffer.allocate(6);
    Profile profile = Profile.of(ProfileKind.CONSTANT, Sense.ATTRACTIVE, 1, 0, 1);
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      long pointer = tool.enter();
      try {
        refused("a struct of 88 bytes: 152 are needed", () -> Native.fs_evaluate(pointer, profile, new Response()));
        refused("distances is not a direct buffer", () -> Native.fs_profile_evaluate(profile, 0, 0, heap, 6, six));
        refused("forces has 48 bytes: it needs 7 times 8", () -> Native.fs_profile_evaluate(profile, 0, 0, null, 7, six));
        refused("distances has 48 bytes", () -> Native.fs_profile_evaluate(profile, 0, 0, six, -1, six));
        refused("list has 100 bytes: it needs 1 times 256",
            () -> Native.fs_device_list(ByteBuffer.allocateDirect(100), 1, new long[1]));
        assertEquals(Status.ERROR_INVALID.value(), Native.fs_evaluate(pointer, null, new Response()));
        assertEquals(Status.ERROR_INVALID.value(), Native.fs_evaluate(pointer, new State(), null));
        assertEquals(Status.ERROR_INVALID.value(), Native.fs_scene_create(null));
        assertThrows(NullPointerException.class, () -> Native.fs_pose_from_z(null, new State(), new State()));
      } finally {
        tool.exit();
      }
    }
  }

  private static void refused(String sentence, Executable call) {
    IllegalArgumentException e = assertThrows(IllegalArgumentException.class, call);
    assertTrue(e.getMessage().contains(sentence), e.getMessage());
  }
}
