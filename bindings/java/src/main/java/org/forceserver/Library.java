package org.forceserver;

import java.io.IOException;
import java.io.InputStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.FileAlreadyExistsException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.attribute.PosixFilePermissions;
import java.util.ArrayList;
import java.util.Collections;
import java.util.List;

/**
 * Loads the library. The jar carries it, what it needs and the glue side by side, and the modules of drivers in a folder below;
 * they find each other by their place. They are written to a private folder. All but the modules are removed as soon as they
 * are loaded; a module is loaded when its scheme is first used, and removed when the JVM ends. The property
 * `forceserver.library` names a folder that has all of them already.
 */
final class Library {
  private static final String GLUE = "libforceserver_java.so", MODULES = "forceserver/drivers-1";

  static void load() {
    String given = System.getProperty("forceserver.library");
    if (given != null) {
      System.load(Path.of(given).toAbsolutePath().resolve(GLUE).toString());
      return;
    }
    String platform = System.getProperty("os.name").toLowerCase() + "-" + System.getProperty("os.arch");
    String place = "native/" + platform + "/";
    List<Path> made = new ArrayList<>();  // each after the folder that it is in
    boolean isLoaded = false;
    try (InputStream names = Library.class.getResourceAsStream(place + "files")) {
      if (names == null) throw new IOException("this jar has no library for " + platform);
      Path folder = privateFolder();
      made.add(folder);
      for (String name : new String(names.readAllBytes(), StandardCharsets.UTF_8).split("\n")) {
        Path file = folder.resolve(name);
        makeFolder(file.getParent(), made);
        made.add(file);
        try (InputStream content = Library.class.getResourceAsStream(place + name)) {
          if (content == null) throw new IOException("the jar lacks " + place + name);
          Files.copy(content, file);
        }
      }
      System.load(folder.resolve(GLUE).toString());
      isLoaded = true;
    } catch (IOException e) {
      throw (UnsatisfiedLinkError) new UnsatisfiedLinkError("forceserver: its library could not be written to "
          + System.getProperty("java.io.tmpdir") + " (-Djava.io.tmpdir names another folder): " + e).initCause(e);
    } catch (UnsatisfiedLinkError e) {
      throw new UnsatisfiedLinkError("forceserver: its library could not be loaded; where no program may run in "
          + System.getProperty("java.io.tmpdir") + ", -Djava.io.tmpdir names another folder: " + e.getMessage());
    } finally {
      // What is loaded stays without its file. Only a JVM that is killed leaves files behind.
      Collections.reverse(made);
      List<Path> left = new ArrayList<>();
      for (Path path : made) {
        boolean isModule = path.getParent().endsWith(MODULES);
        if ((isLoaded && isModule) || !path.toFile().delete()) left.add(path);
      }
      Collections.reverse(left);
      for (Path path : left) path.toFile().deleteOnExit();  // the last one first
    }
  }

  private static void makeFolder(Path folder, List<Path> made) throws IOException {
    if (Files.exists(folder)) return;
    makeFolder(folder.getParent(), made);
    Files.createDirectory(folder);
    made.add(folder);
  }

  /**
   * A folder that only its user can look into. Files.createTempDirectory would do, but first sets up a generator of
   * secrets, which takes 30 ms. The name need not be secret: a folder that somebody else made is never taken.
   */
  private static Path privateFolder() throws IOException {
    String name = System.getProperty("java.io.tmpdir") + "/forceserver-" + ProcessHandle.current().pid() + "-";
    while (true) {
      try {
        return Files.createDirectory(Path.of(name + System.nanoTime()),
            PosixFilePermissions.asFileAttribute(PosixFilePermissions.fromString("rwx------")));
      } catch (FileAlreadyExistsException e) {
        continue;
      }
    }
  }

  private Library() {}
}
