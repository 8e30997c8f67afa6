"""What a user holds: any object in (`verbs`), answers out that print, save and draw themselves (`answers`)."""
