package org.forceserver;

import java.nio.charset.StandardCharsets;

/** Strings as C has them: UTF-8 that ends with a 0. */
final class Text {
  static byte[] bytes(String text) {
    return text == null ? null : bytes("'" + text.replace('\0', '?') + "'", text);
  }

  /** what: how a sentence names it. */
  static byte[] bytes(String what, String text) {
    if (text.indexOf(0) >= 0) throw new IllegalArgumentException(what + " holds a NUL character");
    if (!StandardCharsets.UTF_8.newEncoder().canEncode(text)) {
      throw new IllegalArgumentException(what + " holds half of a surrogate pair");
    }
    return text.getBytes(StandardCharsets.UTF_8);
  }

  static String string(byte[] bytes) {
    return bytes == null ? null : new String(bytes, StandardCharsets.UTF_8);
  }

  private Text() {}
}
