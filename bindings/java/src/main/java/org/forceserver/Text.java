package org.forceserver;

import java.nio.charset.StandardCharsets;

/** Strings as C has them: UTF-8 that ends with a 0. */
final class Text {
  static byte[] bytes(String text) {
    if (text == null) return null;
    if (text.indexOf(0) >= 0) throw new IllegalArgumentException("a text holds the character 0");
    return text.getBytes(StandardCharsets.UTF_8);
  }

  static String string(byte[] bytes) {
    return bytes == null ? null : new String(bytes, StandardCharsets.UTF_8);
  }

  private Text() {}
}
