/* accept.h - content negotiation by the Accept header (RFC 9110, section 12.5.1). */
#ifndef SV_API_ACCEPT_H
#define SV_API_ACCEPT_H

/* The best of `count` offered media types ("image/png", without parameters, in the server's order of
 * preference), or -1 when the header excludes all of them. NULL, an empty header, and one in which nothing is
 * well-formed accept anything. The highest q wins; among equals one that the client names by itself goes
 * before one that a wildcard covers, then the server's order decides. The most specific range that matches a
 * type gives its q. Ranges with parameters other than q match nothing here. Ill-formed elements are passed
 * over. */
int sv_api_accept_choose(const char *accept, const char *const *offers, int count);

#endif
