// The colours of style.css, light or dark, for what is painted by hand: the picture and the plots.

const dark = matchMedia("(prefers-color-scheme: dark)");

/** A colour by the name of its variable in style.css. */
export const themed = (name: string): string => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
/** The person changes from light to dark, or back. */
export const onTheme = (f: () => void): void => dark.addEventListener("change", f);
