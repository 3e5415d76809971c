package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import org.junit.jupiter.api.Test;

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
    wrong("forces has 24 bytes: it needs 2 times 24", six, Buffers.doubles(3));
    wrong("positions has 5 numbers: not a multiple of 3", Buffers.doubles(5), six);
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

  @Test void the_glue_looks_too() {
    ByteBuffer small = ByteBuffer.allocateDirect(State.SIZE - 1), heap = ByteBuffer.allocate(1000);
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      long pointer = tool.enter();
      try {
        Response response = new Response();
        assertTrue(assertThrows(IllegalArgumentException.class, () -> Native.fs_evaluate(pointer, small, response.bytes())).getMessage()
            .contains("state has 151 bytes: it needs 1 times 152"));
        assertTrue(assertThrows(IllegalArgumentException.class, () -> Native.fs_evaluate(pointer, heap, response.bytes())).getMessage()
            .contains("state is not a direct buffer"));
        assertEquals(Status.ERROR_INVALID.value(), Native.fs_evaluate(pointer, null, response.bytes()));
        assertEquals(Status.ERROR_INVALID.value(), Native.fs_scene_create(null));
        assertThrows(NullPointerException.class, () -> Native.fs_pose_from_z(null, small, small));
        assertThrows(IllegalArgumentException.class, () -> Native.fs_profile_evaluate(small, 0, 0, six, -1, six));
      } finally {
        tool.exit();
      }
    }
  }
}
