"""Laws that several causes share: warming up, thermometers, play, speed of struts, screws, weights."""
