package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.nio.file.Files;
import java.nio.file.Path;
import org.junit.jupiter.api.Test;

/** Records, structs, enums and constants that follow from the description. */
class StructTest {
  @Test void inits_are_those_of_c() {
    ForceObject wall = ForceObject.wall("wall", new Vec3(0, 0, 1), new Vec3(0, 2, 0), 500, 10);
    assertEquals("wall", wall.name());
    assertEquals(Primitive.PLANE, wall.primitive());
    assertTrue(wall.enabled());
    assertEquals(new Vec3(0, 0, 1), wall.pose().position());
    assertEquals(ForceServer.poseFromZ(new Vec3(0, 0, 1), new Vec3(0, 2, 0)), wall.pose());
    assertEquals(ProfileKind.LINEAR_INCREASING, wall.back().kind());
    assertEquals(500, wall.back().gain());
    Profile gaussian = Profile.of(ProfileKind.GAUSSIAN, Sense.REPULSIVE, 5, 0.01, 4);
    assertEquals(0.01, gaussian.width());
    assertEquals(0, gaussian.offset());
    assertEquals(1, ForceServer.defaultFrame().scale());
    assertEquals(ServoMode.THREAD, new ServoOptions().mode());
    assertTrue(Double.isNaN(ForceObject.wall("w", Support.ORIGIN, Support.ORIGIN, 1, 1).pose().orientation().w()));
  }

  @Test void a_struct_within_keeps_its_parent() throws Exception {
    Profile front = Support.spring("a").front();
    System.gc();
    Thread.sleep(50);
    assertEquals(200, front.gain(7).gain() + 193);
    ForceObject object = Support.spring("b");
    object.front().gain(3).limit(4);
    assertEquals(3, object.front().gain());
    ForceObject other = Support.spring("c").front(object.front());
    object.front().gain(1);
    assertEquals(3, other.front().gain());
    object.contact().friction(0.5);
    assertEquals(0.5, object.contact().friction());
  }

  @Test void a_call_that_changes_a_struct_changes_it_in_place() {
    SurfaceSettings settings = new SurfaceSettings().staticFriction(0.5).dynamicFriction(0.4);
    assertSame(settings, settings.impact(Impact.MEDIUM));
    assertEquals(8, settings.impactGain());
    assertEquals(100, settings.impactFrequency());
    assertEquals(80, settings.impactDecay());
    assertEquals(0.5, settings.staticFriction());
    assertEquals(new SurfaceSettings().staticFriction(0.5).dynamicFriction(0.4), settings.impact(Impact.NONE));
  }

  @Test void texts() {
    ForceObject object = ForceObject.of("Grüße 😀", Primitive.POINT);
    assertEquals("Grüße 😀", object.name());
    assertEquals("b", object.name("b").name());
    assertThrows(IllegalArgumentException.class, () -> object.name("x".repeat(128)));
    assertThrows(IllegalArgumentException.class, () -> object.name("a\0b"));
    assertThrows(IllegalArgumentException.class, () -> ForceObject.of("a\0b", Primitive.POINT));
    try (Scene scene = new Scene()) {
      scene.set(Support.spring("Grüße 😀"));
      assertEquals("Grüße 😀", scene.reports().get(0).name());
      assertEquals("Grüße 😀", scene.get("Grüße 😀").name());
      Support.refused(Status.ERROR_NOT_FOUND, "schön 😀", () -> scene.remove("schön 😀"));
    }
  }

  @Test void enums_bits_and_constants() {
    assertEquals(Status.ERROR_TIMEOUT, Status.of(-10));
    assertThrows(IllegalArgumentException.class, () -> Status.of(5));
    assertEquals(java.util.EnumSet.of(Fault.DEVICE, Fault.NUMBER), Fault.ofBits(5));
    assertEquals(8, Constants.RESPONSE_GUARDED);
    assertEquals(32, Constants.TOOL_POINTS_MAX);
    assertEquals(0.0, Constants.NOW);
    for (ProfileKind kind : ProfileKind.values()) assertEquals("FS_PROFILE_" + kind, Native.fs_profile_kind_name(kind.value()));
    for (Status status : Status.values()) assertEquals("FS_" + status, Native.fs_status_name(status.value()));
    for (Realtime each : Realtime.values()) assertEquals("FS_REALTIME_" + each, Native.fs_realtime_name(each.value()));
    assertEquals(Constants.VERSION_MAJOR + "." + Constants.VERSION_MINOR + "." + Constants.VERSION_PATCH, ForceServer.version());
  }

  @Test void all_libraries_are_those_of_the_jar() throws Exception {
    ForceServer.version();
    java.util.Set<String> found = new java.util.TreeSet<>();
    for (String line : Files.readAllLines(Path.of("/proc/self/maps"))) {
      java.util.regex.Matcher library = java.util.regex.Pattern.compile("/(lib(forceserver|embree|tbb|muparser|gomp)[^/ ]*)").matcher(line);
      if (!library.find()) continue;
      assertTrue(line.contains("/forceserver-"), line);
      assertTrue(line.endsWith("(deleted)"), line);  // so nothing is left behind however the JVM ends
      found.add(library.group(1));
    }
    assertEquals(6, found.size(), found.toString());
  }

  @Test void nulls() {
    ForceObject object = Support.spring("a");
    assertThrows(NullPointerException.class, () -> object.pose(null));
    assertThrows(NullPointerException.class, () -> object.name(null));
    try (Scene scene = new Scene()) {
      assertThrows(NullPointerException.class, () -> scene.set(null));
      Support.refused(Status.ERROR_INVALID, "null", () -> scene.remove(null));
      assertThrows(NullPointerException.class, () -> new Tool(null));
    }
  }
}
