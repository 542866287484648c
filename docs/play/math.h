/* What the game needs of the C library's <math.h>, for a build without that library.
 *
 * Square root and absolute value are instructions of WebAssembly. Both are rounded correctly, so that they give the same
 * bits as everywhere else.
 */
#define sqrt __builtin_sqrt
#define fabs __builtin_fabs
#define INFINITY __builtin_inf()
