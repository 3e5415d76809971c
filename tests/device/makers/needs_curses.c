/* A library that needs a function of another one, libncurses.so.5, which is missing. */
int missing_curses(void);
int needs_curses(void);
int needs_curses(void) { return missing_curses(); }
