package org.forceserver;

import static org.junit.jupiter.api.Assertions.*;

import java.lang.ref.WeakReference;
import java.util.ArrayList;
import java.util.Collections;
import java.util.List;
import java.util.Random;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.concurrent.atomic.AtomicReference;
import org.junit.jupiter.api.Test;

/** Every order of closing and collection. */
class ClosingTest {
  private static List<Handle> everything(int number) throws InterruptedException {
    Scene scene = new Scene();
    Shape shape = Shape.polyline(false, Support.ORIGIN, Support.UP);
    Curve curve = Curve.table(0.01, 1, 2);
    scene.set(ForceObject.of("a", Primitive.POLYLINE).shape(shape)
        .front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(curve)));
    Tool tool = new Tool(scene);
    Device device = new Device("sim:");
    Servo servo = new Servo(scene, device, new ServoOptions().mode(ServoMode.VIRTUAL));
    Server server = servo.serve("shm:java-closing-" + ProcessHandle.current().pid() + "-" + number);
    servo.step(10);
    return new ArrayList<>(List.of(scene, shape, curve, tool, device, servo, server));
  }

  @Test void every_order_of_closing() throws Exception {
    Random random = new Random(3);
    for (int round = 0; round < 100; ++round) {
      List<Handle> handles = everything(round);
      Collections.shuffle(handles, random);
      for (Handle handle : handles) {
        handle.close();
        handle.close();
      }
    }
  }

  @Test void every_order_of_collection() throws Exception {
    List<WeakReference<Handle>> gone = new ArrayList<>();
    Random random = new Random(4);
    for (int round = 0; round < 40; ++round) {
      List<Handle> handles = everything(1000 + round);
      Collections.shuffle(handles, random);
      for (Handle handle : handles) {
        gone.add(new WeakReference<>(handle));
        if (random.nextInt(3) == 0) handle.close();
      }
      while (!handles.isEmpty()) {
        handles.remove(handles.size() - 1);
        if (random.nextInt(10) == 0) System.gc();
      }
    }
    Support.collect(() -> gone.stream().allMatch(each -> each.get() == null));
  }

  @Test void what_is_closed_refuses_calls() throws Exception {
    Scene scene = new Scene();
    Tool tool = new Tool(scene);
    Device device = new Device("sim:");
    Servo servo = new Servo(scene, device, new ServoOptions().mode(ServoMode.VIRTUAL));
    scene.close();
    tool.evaluate(new State());  // goes on: the handle keeps what it was made from
    servo.step(1);
    for (Handle handle : List.of(tool, device, servo)) handle.close();
    assertEquals("this Scene is closed", assertThrows(IllegalStateException.class, scene::time).getMessage());
    assertThrows(IllegalStateException.class, scene::clear);
    assertThrows(IllegalStateException.class, scene::change);
    assertThrows(IllegalStateException.class, () -> new Tool(scene));
    assertThrows(IllegalStateException.class, () -> scene.nextEvent(1));
    assertThrows(IllegalStateException.class, () -> tool.evaluate(new State()));
    assertThrows(IllegalStateException.class, tool::reset);
    assertThrows(IllegalStateException.class, device::read);
    assertThrows(IllegalStateException.class, () -> servo.step(1));
    assertThrows(IllegalStateException.class, servo::record);
  }

  @Test void a_collected_servo_stops() throws Exception {
    try (Scene scene = new Scene()) {
      forget(scene);
      Support.collect(() -> {
        try {
          scene.hand();
          return false;
        } catch (ForceServerException e) {
          return e.status() == Status.ERROR_STATE;
        }
      });
    }
  }

  private static void forget(Scene scene) {
    Servo servo = Support.servo(scene, ServoMode.THREAD);
    servo.setEnabled(true);
    scene.hand();
  }

  @Test void a_server_keeps_its_servo() throws Exception {
    try (Scene scene = new Scene()) {
      String endpoint = "shm:java-keeps-" + ProcessHandle.current().pid();
      try (Server server = Support.servo(scene, ServoMode.THREAD).serve(endpoint)) {
        for (int i = 0; i < 5; ++i) {
          System.gc();
          Thread.sleep(20);
        }
        scene.hand();
        assertNotNull(server.servo());
        server.servo().close();
      }
    }
  }

  @Test void what_is_used_is_not_collected() throws Exception {
    AtomicReference<Throwable> bad = new AtomicReference<>();
    List<Thread> threads = new ArrayList<>();
    for (int k = 0; k < 2; ++k) {
      threads.add(new Thread(() -> {
        State state = new State();
        try {
          for (int i = 0; i < 20000; ++i) {
            new Tool(new Scene()).evaluate(state, new Response());
            Shape.polyline(false, Support.ORIGIN, Support.UP).points();
          }
        } catch (Throwable e) {
          bad.set(e);
        }
      }));
    }
    threads.forEach(Thread::start);
    while (threads.stream().anyMatch(Thread::isAlive)) {
      System.gc();
      Thread.sleep(1);
    }
    assertNull(bad.get());
  }

  @Test void close_while_others_call() throws Exception {
    for (int round = 0; round < 50; ++round) {
      Scene scene = new Scene();
      scene.set(Support.spring("a"));
      Tool tool = new Tool(scene);
      Servo servo = Support.servo(scene, ServoMode.VIRTUAL);
      AtomicInteger calls = new AtomicInteger();
      AtomicReference<Throwable> bad = new AtomicReference<>();
      List<Thread> threads = new ArrayList<>();
      List<Runnable> works = List.of(
          () -> tool.evaluate(new State()),
          () -> scene.move("a", Support.at(0.01, 0, 0)),
          () -> scene.reports(),
          () -> scene.evaluate(Buffers.doubles(300), Buffers.doubles(300)),
          () -> {
            try {
              servo.step(1000000);
            } catch (InterruptedException e) {
              throw new AssertionError(e);
            }
          },
          servo::record);
      for (Runnable work : works) {
        Thread thread = new Thread(() -> {
          try {
            while (true) {
              work.run();
              calls.incrementAndGet();
            }
          } catch (IllegalStateException closed) {
            return;
          } catch (ForceServerException e) {
            if (e.status() != Status.ERROR_STATE) bad.set(e);
          } catch (Throwable e) {
            bad.set(e);
          }
        });
        thread.start();
        threads.add(thread);
      }
      Thread.sleep(5);
      List<Handle> handles = new ArrayList<>(List.of(scene, tool, servo));
      Collections.shuffle(handles, new Random(round));
      for (Handle handle : handles) handle.close();
      for (Thread thread : threads) {
        thread.join(20000);
        assertFalse(thread.isAlive());
      }
      assertNull(bad.get());
    }
  }

  @Test void two_close_at_once() throws Exception {
    for (int round = 0; round < 200; ++round) {
      Scene scene = new Scene();
      Servo servo = Support.servo(scene, ServoMode.CALLER);
      Thread other = new Thread(servo::close);
      other.start();
      servo.close();
      Support.refused(Status.ERROR_STATE, "", scene::hand);  // it has been stopped when close() returns
      other.join();
      scene.close();
    }
  }
}
