package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.atomic.AtomicBoolean;
import java.util.concurrent.atomic.AtomicReference;
import org.junit.jupiter.api.Test;

/** Groups: all or nothing, and only one thread's. */
class ChangeTest {
  @Test void a_change_that_is_committed_is_there() throws Exception {
    try (Scene scene = new Scene()) {
      try (Change change = scene.change()) {
        scene.set(Support.spring("a"));
        scene.set(Support.spring("b"));
        assertEquals(0, scene.evaluate(new Vec3(0.01, 0, 0)).x());
        change.commit();
        assertThrows(IllegalStateException.class, change::commit);
      }
      assertEquals(-4, scene.evaluate(new Vec3(0.01, 0, 0)).x(), 1e-12);
    }
  }

  @Test void without_commit_or_after_an_exception_nothing_is() throws Exception {
    try (Scene scene = new Scene()) {
      try (Change change = scene.change()) {
        scene.set(Support.spring("a"));
        assertNotNull(change);
      }
      assertTrue(scene.reports().isEmpty());
      assertThrows(ForceServerException.class, () -> {
        try (Change change = scene.change()) {
          scene.set(Support.spring("a"));
          scene.remove("b");
          change.commit();
        }
      });
      assertTrue(scene.reports().isEmpty());
      scene.set(Support.spring("c"));
      assertEquals(1, scene.reports().size());
    }
  }

  @Test void nesting_is_refused_and_the_first_goes_on() throws Exception {
    try (Scene scene = new Scene(); Scene other = new Scene(); Change change = scene.change(); Change beside = other.change()) {
      scene.set(Support.spring("a"));
      assertThrows(IllegalStateException.class, scene::change);
      change.commit();
      beside.commit();
      assertEquals(1, scene.reports().size());
    }
  }

  @Test void changes_of_other_threads_go_past() throws Exception {
    try (Scene scene = new Scene()) {
      AtomicReference<Throwable> refusal = new AtomicReference<>(), bad = new AtomicReference<>();
      try (Change change = scene.change()) {
        scene.set(Support.spring("mine"));
        Thread other = new Thread(() -> {
          try {
            assertThrows(NotFoundException.class, () -> scene.get("mine"));
            try (Change own = scene.change()) {
              scene.set(Support.spring("other"));
              own.commit();
            }
            change.commit();
          } catch (IllegalStateException e) {
            refusal.set(e);
          } catch (Throwable e) {
            bad.set(e);
          }
        });
        other.start();
        other.join();
        assertNull(bad.get());
        assertNotNull(refusal.get());
        assertEquals(List.of("other"), scene.reports().stream().map(Report::name).filter(name -> !name.equals("mine")).toList());
      }
      assertEquals(List.of("other"), scene.reports().stream().map(Report::name).toList());
    }
  }

  @Test void an_interrupted_thread_opens_none() throws Exception {
    try (Scene scene = new Scene()) {
      Thread.currentThread().interrupt();
      assertThrows(InterruptedException.class, scene::change);
      try (Change change = scene.change()) {
        change.commit();
      }
    }
  }

  @Test void an_interrupt_within_a_change_takes_it_back() throws Exception {
    try (Scene scene = new Scene(); Servo servo = Support.servo(scene, ServoMode.VIRTUAL)) {
      assertThrows(InterruptedException.class, () -> {
        try (Change change = scene.change()) {
          scene.set(Support.spring("a"));
          Thread.currentThread().interrupt();
          servo.step(1000);
          change.commit();
        }
      });
      assertFalse(Thread.interrupted());
      assertTrue(scene.reports().isEmpty());
      scene.set(Support.spring("b"));
    }
  }

  @Test void a_scene_closed_within_a_change() throws Exception {
    Scene scene = new Scene();
    try (Change change = scene.change()) {
      scene.set(Support.spring("a"));
      scene.close();
      assertThrows(IllegalStateException.class, change::commit);
    }
    Scene other = new Scene();
    Change change = other.change();
    Thread closes = new Thread(other::close);
    closes.start();
    closes.join();
    change.close();
  }

  @Test void threads_that_evaluate_and_edit_at_once() throws Exception {
    try (Scene scene = new Scene()) {
      for (int i = 0; i < 2; ++i) scene.set(Support.spring("s" + i).front(Profile.of(ProfileKind.CONSTANT, Sense.ATTRACTIVE, 1, 0, 9)));
      AtomicReference<Throwable> bad = new AtomicReference<>();
      AtomicBoolean end = new AtomicBoolean();
      CountDownLatch ready = new CountDownLatch(4);
      List<Thread> threads = new ArrayList<>();
      for (int k = 0; k < 2; ++k) {
        threads.add(new Thread(() -> {
          try (Tool tool = new Tool(scene)) {
            ready.countDown();
            State state = new State().pose(Support.at(0.05, 0, 0));
            while (!end.get()) {
              // Both springs change together, so the sum is even: 2, 4, 6.. N.
              double force = -tool.evaluate(state).wrench().force().x();
              if (Math.abs(force / 2 - Math.rint(force / 2)) > 1e-9) throw new AssertionError("half a change: " + force);
            }
          } catch (Throwable e) {
            bad.set(e);
          }
        }));
        int mine = k;
        threads.add(new Thread(() -> {
          ready.countDown();
          try {
            for (int i = 0; i < 3000; ++i) {
              try (Change change = scene.change()) {
                for (int j = 0; j < 2; ++j) {
                  ForceObject object = scene.get("s" + j);
                  object.front().gain(1 + (i + mine) % 4);
                  scene.change(object, Part.PROFILES);
                }
                if (i % 10 != 0) change.commit();
              }
            }
          } catch (Throwable e) {
            bad.set(e);
          }
        }));
      }
      threads.forEach(Thread::start);
      for (int i = 1; i < 4; i += 2) threads.get(i).join();
      end.set(true);
      for (Thread thread : threads) thread.join();
      assertNull(bad.get());
    }
  }

  @Test void one_tool_by_several_threads() throws Exception {
    try (Scene scene = new Scene(); Tool tool = new Tool(scene)) {
      scene.set(Support.spring("a"));
      AtomicReference<Throwable> bad = new AtomicReference<>();
      List<Thread> threads = new ArrayList<>();
      for (int k = 0; k < 4; ++k) {
        double x = 0.001 * (k + 1);
        threads.add(new Thread(() -> {
          State state = new State().pose(Support.at(x, 0, 0));
          Response response = new Response();
          for (int i = 0; i < 20000 && bad.get() == null; ++i) {
            tool.evaluate(state, response);
            if (Math.abs(response.wrench().force().x() + 200 * x) > 1e-9) bad.set(new AssertionError(response.wrench().toString()));
          }
        }));
      }
      threads.forEach(Thread::start);
      for (Thread thread : threads) thread.join();
      assertNull(bad.get());
    }
  }
}
