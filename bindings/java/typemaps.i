/* How the types of the contract look in Java: a handle is a long; a struct is the address of a direct ByteBuffer, of
 * which Struct looks whether it has the size; an array is a direct buffer of numbers; an enum is an int; a string is a
 * String. Null stays null, and the library says where that is an error. A status is left to the classes by hand. */
%module Native
%pragma(java) moduleclassmodifiers="final class"
%pragma(java) jniclassclassmodifiers="final class"
%pragma(java) jniclasscode=%{
  static {
    Library.load();
  }
%}

%{
#include <string>

#include <forceserver/forceserver.h>
#include <forceserver/driver.h>

namespace {

bool refuse(JNIEnv *env, const char *type, const std::string &why)
{
  jclass exception = env->FindClass(type);
  if (exception) env->ThrowNew(exception, why.c_str());
  return false;
}

/* The memory of a direct buffer whose elements have `unit` bytes. */
template<class T>
bool open_buffer(JNIEnv *env, const char *name, jobject buffer, size_t unit, T *&memory, size_t &bytes)
{
  memory = nullptr;
  bytes = 0;
  if (!buffer) return true;
  void *address = env->GetDirectBufferAddress(buffer);
  const jlong count = env->GetDirectBufferCapacity(buffer);
  if (count < 0) {
    return refuse(env, "java/lang/IllegalArgumentException", std::string(name) + " is not a direct buffer");
  }
  memory = static_cast<T *>(address);
  bytes = static_cast<size_t>(count) * unit;
  return true;
}

bool enough(JNIEnv *env, const char *name, const void *memory, size_t bytes, size_t count, size_t size)
{
  if (!memory || count <= bytes / size) return true;
  return refuse(env, "java/lang/IllegalArgumentException", std::string(name) + " has " + std::to_string(bytes) +
                " bytes: it needs " + std::to_string(count) + " times " + std::to_string(size));
}

bool read_text(JNIEnv *env, jbyteArray bytes, std::string &text, char *&out)
{
  out = nullptr;
  if (!bytes) return true;
  text.resize(static_cast<size_t>(env->GetArrayLength(bytes)));
  env->GetByteArrayRegion(bytes, 0, static_cast<jsize>(text.size()), reinterpret_cast<jbyte *>(text.data()));
  out = text.data();
  return true;
}

jbyteArray make_text(JNIEnv *env, const char *text)
{
  if (!text) return nullptr;
  const jsize size = static_cast<jsize>(strlen(text));
  jbyteArray bytes = env->NewByteArray(size);
  if (bytes) env->SetByteArrayRegion(bytes, 0, size, reinterpret_cast<const jbyte *>(text));
  return bytes;
}

void copy_memory(size_t address, void *to, size_t bytes)
{
  if (to) memcpy(to, reinterpret_cast<const void *>(address), bytes);
}

size_t address_of(void *of)
{
  return reinterpret_cast<size_t>(of);
}

}  // namespace
%}

%define IN_JAVA(TYPE, NAME, JNI, JAVA)
%typemap(jni) TYPE NAME "JNI"
%typemap(jtype) TYPE NAME "JAVA"
%typemap(jstype) TYPE NAME "JAVA"
%typemap(javain) TYPE NAME "$javainput"
%typemap(javaout) TYPE NAME { return $jnicall; }
%enddef

%define NUMBER(TYPE, JNI, JAVA)
IN_JAVA(TYPE, , JNI, JAVA)
%typemap(in) TYPE %{ $1 = (TYPE)$input; %}
%typemap(out) TYPE %{ $result = (JNI)$1; %}
%enddef

/* A struct behind a pointer, or by value: its address, which Java knows (to ask for that of a buffer costs 35 ns). Its
 * memory stays until the call has ended. */
%define STRUCT(TYPE, SIZE)
%typemap(jni) TYPE, TYPE *, const TYPE * "jlong"
%typemap(jtype) TYPE, TYPE *, const TYPE * "long"
%typemap(jstype) TYPE, TYPE *, const TYPE * "Struct"
%typemap(javain, post="      java.lang.ref.Reference.reachabilityFence($javainput);")
  TYPE, TYPE *, const TYPE * "Struct.address($javainput, SIZE)"
%typemap(in) TYPE *, const TYPE * %{ $1 = (TYPE *)(intptr_t)$input; %}
%typemap(in) TYPE %{
  if (!$input) {
    refuse(jenv, "java/lang/NullPointerException", "$1_name");
    return $null;
  }
  $1 = *(TYPE *)(intptr_t)$input;
%}
%enddef

/* An array: its buffer, the bytes of an element of the buffer, which argument has the count, and the bytes of one. */
%define ARRAY(TYPE, NAME, BUFFER, UNIT, COUNT, SIZE)
IN_JAVA(TYPE, NAME, jobject, java.nio.BUFFER)
%typemap(in) TYPE NAME (size_t bytes) %{ if (!open_buffer(jenv, "$1_name", $input, UNIT, $1, bytes)) return $null; %}
%typemap(argout) TYPE NAME ""
%typemap(check) TYPE NAME %{ if (!enough(jenv, "$1_name", $1, bytes$argnum, COUNT, SIZE)) return $null; %}
%enddef

/* A number that a call gives: the first entry of an array. */
%define GIVEN(TYPE, JNI, JAVA, SET)
IN_JAVA(TYPE *, , JNI##Array, JAVA[])
%typemap(in) TYPE * (TYPE given = 0) %{ $1 = $input ? &given : nullptr; %}
%typemap(argout) TYPE * %{
  if ($input) {
    const JNI value$argnum = (JNI)given$argnum;
    jenv->SET($input, 0, 1, &value$argnum);
  }
%}
%enddef

%define HANDLE(TYPE)
IN_JAVA(TYPE *, , jlong, long)
IN_JAVA(const TYPE *, , jlong, long)
%typemap(in) TYPE *, const TYPE * %{ $1 = (TYPE *)(intptr_t)$input; %}
%typemap(out) TYPE * %{ $result = (jlong)(intptr_t)$1; %}
IN_JAVA(TYPE **, , jlongArray, long[])
%typemap(in) TYPE ** (TYPE *made = nullptr) %{ $1 = $input ? &made : nullptr; %}
%typemap(argout) TYPE ** %{
  if ($input) {
    const jlong value$argnum = (jlong)(intptr_t)made$argnum;
    jenv->SetLongArrayRegion($input, 0, 1, &value$argnum);
  }
%}
%enddef

NUMBER(fs_status, jint, int)
NUMBER(int32_t, jint, int)
NUMBER(uint32_t, jint, int)
NUMBER(uint64_t, jlong, long)
NUMBER(size_t, jlong, long)
GIVEN(size_t, jlong, long, SetLongArrayRegion)
GIVEN(double, jdouble, double, SetDoubleArrayRegion)
GIVEN(int32_t, jint, int, SetIntArrayRegion)
GIVEN(uint32_t, jint, int, SetIntArrayRegion)
GIVEN(uint64_t, jlong, long, SetLongArrayRegion)
GIVEN(bool, jboolean, boolean, SetBooleanArrayRegion)

/* UTF-8; that of the JNI's own functions is another. */
%typemap(jni) const char * "jbyteArray"
%typemap(jtype) const char * "byte[]"
%typemap(jstype) const char * "String"
%typemap(javain) const char * "Text.bytes($javainput)"
%typemap(javaout) const char * { return Text.string($jnicall); }
%typemap(in) const char * (std::string text) %{ if (!read_text(jenv, $input, text, $1)) return $null; %}
%typemap(freearg) const char * ""
%typemap(out) const char * %{ $result = make_text(jenv, $1); %}

/* What lives with a handle: its address, from which it is copied while the handle is there. */
%define MEMORY_OF_HANDLE(TYPE)
%typemap(jni) const TYPE * "jlong"
%typemap(jtype) const TYPE * "long"
%typemap(jstype) const TYPE * "long"
%typemap(javaout) const TYPE * { return $jnicall; }
%typemap(out) const TYPE * %{ $result = (jlong)(intptr_t)$1; %}
%enddef
ARRAY(void *, to, ByteBuffer, 1, arg3, 1)
void copy_memory(size_t address, void *to, size_t bytes);
ARRAY(void *, of, Buffer, 1, 0, 1)
size_t address_of(void *of);
